"""Simulated stepped-sine experiments."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from idloop.physics import Model, simulate
from idloop.records import Record
from idloop.signals import Signal, build_signal

STEP = 0.005


@pytest.fixture(scope="session")
def stepped() -> Callable[..., tuple[Signal, Record]]:
    """Factory: a stepped sine sent into a model, with the measurement noise of its outputs where asked."""

    def make(
        model: Model,
        amplitude: float,
        frequencies: tuple[float, ...],
        periods: int = 4,
        settle: int = 3,
        seed: int | None = None,
    ) -> tuple[Signal, Record]:
        signal = build_signal(
            "stepped_sine",
            sample_time=STEP,
            amplitude=amplitude,
            frequencies=frequencies,
            periods=periods,
            settle_periods=settle,
        )
        time = np.arange(signal.value.size + 1) * STEP
        noise = None
        if seed is not None:
            shape = (time.size, len(model.outputs))
            noise = np.random.default_rng(seed).normal(size=shape) * [output.noise for output in model.outputs]
        output = simulate(model, signal.time, signal.value, time, noise=noise).output
        units = tuple(output.unit for output in model.outputs)
        record = Record(
            f"sine-{amplitude:g}",
            signal.time,
            signal.value,
            time,
            output,
            model.input.name,
            model.input.unit,
            model.output_names,
            units,
        )
        return signal, record

    return make
