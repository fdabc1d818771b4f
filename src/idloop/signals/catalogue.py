"""Every kind of excitation, and the parameters that all of them share."""

from __future__ import annotations

from idloop.parameter_table import REQUIRED, ParameterSpec
from idloop.signals import (
    chirp,
    coast_down,
    constant,
    multilevel,
    multisine,
    prbs,
    rgs,
    saw,
    sine,
    smooth,
    square,
    step,
    stepped_sine,
    triangle,
    zero,
)
from idloop.signals.base import SignalKind

COMMON_PARAMETERS: tuple[ParameterSpec, ...] = (
    ParameterSpec(
        "sample_time",
        "float",
        REQUIRED,
        "Time between samples.",
        unit="s",
        minimum=0.0,
        exclusive=True,
    ),
    ParameterSpec(
        "duration",
        "float",
        None,
        "Length of the signal; some kinds choose their own when it is left out.",
        unit="s",
        minimum=0.0,
        exclusive=True,
    ),
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
    module.KIND.name: module.KIND
    for module in (
        zero,
        constant,
        step,
        sine,
        square,
        saw,
        triangle,
        stepped_sine,
        chirp,
        prbs,
        rgs,
        multilevel,
        multisine,
        coast_down,
        smooth,
    )
}
