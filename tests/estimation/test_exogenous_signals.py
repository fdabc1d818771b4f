"""Exogenous signals of a record, and whether feedback is possible."""

import numpy as np
import pytest

from idloop.estimation.feedback import exogenous_signals, feedback_possible
from idloop.records import Record

TIME = 0.01 * np.arange(1500)


def recorded(*, gain: float, reference: bool) -> Record:
    """An integrator under a proportional controller of some gain that acts one sample late."""
    rng = np.random.default_rng(0)
    asked = np.sin(TIME) if reference else np.zeros(len(TIME))
    state, position, command = 0.0, np.zeros(len(TIME)), np.zeros(len(TIME))
    for i in range(len(TIME)):
        position[i] = state + 0.01 * rng.normal()
        command[i] = gain * (asked[i] - position[max(i - 1, 0)]) + rng.normal()
        state += 0.01 * command[i]
    reference_columns = np.column_stack([asked, np.full(len(TIME), np.nan)]) if reference else None
    return Record(
        "run", TIME, command, TIME, position[:, None], "axis.effort", "N·m", ("axis.position",), ("rad",),
        reference_time=TIME if reference else None, reference=reference_columns,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("gain", "reference", "closed"), [(0.0, False, False), (50.0, False, True), (50.0, True, True)]
)
def test_a_loop_is_detected_by_its_reference_or_by_fed_back_noise(gain: float, reference: bool, closed: bool) -> None:
    assert feedback_possible(recorded(gain=gain, reference=reference)) is closed


def test_a_record_that_is_too_short_counts_as_open() -> None:
    assert not feedback_possible(recorded(gain=50.0, reference=False).cut(0.0, 0.05))


def test_only_changing_signals_are_exogenous() -> None:
    assert exogenous_signals(recorded(gain=1.0, reference=False), TIME) == []
    (asked,) = exogenous_signals(recorded(gain=1.0, reference=True), TIME)
    assert asked == pytest.approx(np.sin(TIME))
