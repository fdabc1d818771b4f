"""All kinds of excitation signals, and how they are built by name and parameters."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from idloop.arrays import Array
from idloop.errors import InputError
from idloop.parameter_table import REQUIRED, ParameterSpec, check_values, positive
from idloop.signals import chirp, coast_down, multilevel, multisine, prbs, rgs, smooth, stepped_sine
from idloop.signals.base import LONGEST, Request, Shape, SignalKind
from idloop.signals.signal import Signal
from idloop.signals.waves import CONSTANT, SAW, SINE, SQUARE, STEP, TRIANGLE, ZERO
from idloop.spelling import did_you_mean

COMMON_PARAMETERS: tuple[ParameterSpec, ...] = (
    positive("sample_time", REQUIRED, "Time between samples.", "s"),
    positive("duration", None, "Length of the signal; some kinds choose their own when it is left out.", "s"),
    ParameterSpec("amplitude", "float", 1.0, "Peak about the offset (rgs: standard deviation).", minimum=0.0),
    ParameterSpec("offset", "float", 0.0, "Added to the whole signal."),
    ParameterSpec("seed", "int", 0, "Equal seeds give equal signals.", minimum=0, maximum=2**53),
    ParameterSpec(
        "ramp_in",
        "float",
        0.0,
        "Time in which the whole signal, offset included, fades in from zero (smooth ignores it).",
        unit="s",
        minimum=0.0,
    ),
)

SIGNALS: dict[str, SignalKind] = {
    kind.name: kind
    for kind in (
        *(ZERO, CONSTANT, STEP, SINE, SQUARE, SAW, TRIANGLE),
        *(stepped_sine.KIND, chirp.KIND, prbs.KIND, rgs.KIND, multilevel.KIND, multisine.KIND),
        *(coast_down.KIND, smooth.KIND),
    )
}


def build_signal(name: str, **parameters: Any) -> Signal:
    """Build an excitation signal.

    Parameters
    ----------
    name : str
        A key of ``SIGNALS``.
    **parameters
        The common ones (``COMMON_PARAMETERS``: ``sample_time``, ``duration``, ``amplitude``,
        ``offset``, ``seed``, ``ramp_in``) and those of the kind (``SIGNALS[name].parameters``).

    Raises
    ------
    InputError
        Unknown kind or parameter, a value out of range, or parameters that contradict each other.
    """
    values = check_signal(name, parameters)
    kind = SIGNALS[name]
    common = {spec.name: values[spec.name] for spec in COMMON_PARAMETERS}
    own = {spec.name: values[spec.name] for spec in kind.parameters}
    request = _request(kind, common)
    shape = kind.generate(request, **own)
    if shape.value.size > LONGEST:
        raise request.error(f"{shape.value.size} samples are too many (at most {LONGEST}); give a duration")
    return Signal(
        name=name,
        time=np.arange(shape.value.size, dtype=np.float64) * request.sample_time,
        value=_scaled(shape, request, common["ramp_in"]),
        parameters=values,
        period_samples=shape.period_samples,
        segments=shape.segments,
        lines=shape.lines,
        rate=shape.rate,
        derived=shape.derived,
        notes=shape.notes,
    )


def check_signal(name: str, parameters: dict[str, Any]) -> dict[str, Any]:
    """Every parameter of a signal kind, checked one by one, with its default where it is left out."""
    if name not in SIGNALS:
        hint = did_you_mean(name, SIGNALS)
        raise InputError(f"signal: unknown kind {name!r}{hint}; known: {', '.join(SIGNALS)}")
    return check_values((*COMMON_PARAMETERS, *SIGNALS[name].parameters), parameters, f"signal {name}")


def ramp(samples: int, sample_time: float, ramp_in: float) -> Array:
    """Half-cosine fade from 0 to 1 over `ramp_in` seconds, shape (samples,)."""
    if ramp_in <= 0.0:
        return np.ones(samples)
    fraction = np.minimum(np.arange(samples) * sample_time, ramp_in) / ramp_in
    fade: Array = 0.5 - 0.5 * np.cos(math.pi * fraction)
    return fade


def _request(kind: SignalKind, common: dict[str, Any]) -> Request:
    duration, sample_time = common["duration"], common["sample_time"]
    samples = None
    if duration is not None:
        if duration / sample_time > LONGEST:
            raise InputError(
                f"signal {kind.name}: {duration:g} s at a sample time of {sample_time:g} s are "
                f"more than {LONGEST} samples; shorten duration or raise sample_time"
            )
        samples = round(duration / sample_time)
        if samples < 1:
            raise InputError(
                f"signal {kind.name}: duration ({duration:g} s) is shorter than sample_time "
                f"({sample_time:g} s); lengthen it"
            )
    elif not kind.natural_length:
        raise InputError(f"signal {kind.name}: duration is missing; give the length in seconds")
    return Request(kind.name, sample_time, samples, common["amplitude"], common["offset"], common["seed"])


def _scaled(shape: Shape, request: Request, ramp_in: float) -> Array:
    if shape.absolute:
        return shape.value
    fade = ramp(shape.value.size, request.sample_time, ramp_in)
    return fade * (request.offset + request.amplitude * shape.value)
