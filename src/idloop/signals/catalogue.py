"""All kinds of excitation signals, and their common parameters."""

from __future__ import annotations

from idloop.parameter_table import REQUIRED, ParameterSpec, positive
from idloop.signals import chirp, coast_down, multilevel, multisine, prbs, rgs, smooth, stepped_sine
from idloop.signals.base import SignalKind
from idloop.signals.levels import CONSTANT, STEP, ZERO
from idloop.signals.waves import SAW, SINE, SQUARE, TRIANGLE

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
