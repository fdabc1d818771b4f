"""A limited rate of the command is named; a delay and a lag, which make jumps gradual as well, are not."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from idloop.records.inspection.faults import rate_limit

LEVELS = np.repeat(np.sign(np.random.default_rng(3).normal(size=600)), 5)
STEP, SAMPLE = 0.3, 0.005


def later(delay: float) -> Callable[[float], float]:
    """Return a drive that is late by a part of a sample: in that part the old command acts."""
    last = LEVELS[0]

    def apply(value: float) -> float:
        nonlocal last
        applied = (1.0 - delay) * value + delay * last
        last = value
        return float(applied)

    return apply


def slower(decay: float) -> Callable[[float], float]:
    """Return a drive with a lag of first order."""
    applied = 0.0

    def apply(value: float) -> float:
        nonlocal applied
        applied = decay * applied + (1.0 - decay) * value
        return applied

    return apply


def limited(value: Callable[[float], float]) -> Callable[[float], float]:
    """Return a drive that limits the rate of what another one applies."""
    applied = 0.0

    def apply(sent: float) -> float:
        nonlocal applied
        applied += float(np.clip(value(sent) - applied, -STEP, STEP))
        return applied

    return apply


@pytest.mark.parametrize("delay", [0.3, 0.5, 0.82, 1.0])
def test_a_delay_of_part_of_a_sample_is_no_limit(make_axis, delay):
    assert rate_limit.check(make_axis(command=LEVELS, drive=later(delay))) == []


def test_a_lag_with_a_delay_is_no_limit(make_axis):
    lag, delay = slower(0.5), later(0.6)
    assert rate_limit.check(make_axis(command=LEVELS, drive=lambda value: lag(delay(value)))) == []


@pytest.mark.parametrize("delay", [0.0, 0.6])
def test_a_limit_is_named_with_and_without_a_delay(make_axis, delay):
    (found,) = rate_limit.check(make_axis(command=LEVELS, drive=limited(later(delay))))
    assert found.evidence["rate"] == pytest.approx(STEP / SAMPLE, rel=0.2)
