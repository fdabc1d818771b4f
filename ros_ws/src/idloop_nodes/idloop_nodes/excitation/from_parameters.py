"""Signals and limits from the parameters of the excitation node."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from idloop.signals import SIGNALS, build_signal
from idloop_nodes.excitation.experiment import Limits
from idloop_nodes.parameters import Values

LIMITS = ("amplitude", "position_min", "position_max", "velocity")
COMMON = ("sample_time", "duration", "amplitude", "offset", "seed", "ramp_in")


def normal_signal(values: Values) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return value and rate of the whole normal signal, each of shape (n,)."""
    kind = values["signal"]
    own = {spec.name: values[f"{kind}.{spec.name}"] for spec in SIGNALS[kind].parameters}
    given = own | {name: values[name] for name in COMMON}
    signal = build_signal(kind, **{name: value for name, value in given.items() if value is not None})
    return signal.value, np.zeros_like(signal.value) if signal.rate is None else signal.rate


def return_time(values: Values) -> float | None:
    """Return the time of the way back to the beginning of a signal that repeats [s]; None where it ends."""
    return float(values["handover_time"]) if values["repeat"] else None


def experiment_limits(values: Values) -> Limits:
    """Return what an experiment must keep within."""
    return Limits(**{name: values[f"limit.{name}"] for name in LIMITS})
