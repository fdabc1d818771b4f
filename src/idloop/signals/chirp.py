"""A swept sine, linear or logarithmic."""

from __future__ import annotations

import math

import numpy as np

from idloop.parameter_table import ParameterSpec, positive
from idloop.signals.base import Request, Shape, SignalKind


def generate(
    request: Request, *, frequency_start: float, frequency_end: float | None, sweep: str, sweep_time: float | None
) -> Shape:
    """Sweep from one frequency to the other, starting at phase zero, again and again."""
    end = request.rate / 10.0 if frequency_end is None else frequency_end
    request.check_frequency("frequency_start", frequency_start)
    request.check_frequency("frequency_end", end)
    length = request.length if sweep_time is None else max(request.to_samples(sweep_time), 1)
    time = (np.arange(request.length) % length) * request.sample_time
    duration = length * request.sample_time
    ratio = end / frequency_start
    if sweep == "linear":
        cycles = frequency_start * time + 0.5 * (end - frequency_start) / duration * time**2
    elif abs(math.log(ratio)) < 1e-12:
        cycles = frequency_start * time
    else:
        cycles = frequency_start * duration / math.log(ratio) * np.expm1(time / duration * math.log(ratio))
    derived = {"frequency_end": end, "sweep_time": duration}
    repeats = length < request.length
    return Shape(np.sin(2.0 * math.pi * cycles), period_samples=length if repeats else None, derived=derived)


KIND = SignalKind(
    "chirp",
    "Swept sine.",
    (
        positive("frequency_start", 0.1, "Frequency at the start.", "Hz"),
        positive("frequency_end", None, "Frequency at the end; left out, a tenth of the sample rate.", "Hz"),
        ParameterSpec(
            "sweep", "str", "logarithmic", "How the frequency grows with time.", choices=("linear", "logarithmic")
        ),
        positive("sweep_time", None, "Length of one sweep, repeated; left out, one sweep fills the duration.", "s"),
    ),
    generate,
)
