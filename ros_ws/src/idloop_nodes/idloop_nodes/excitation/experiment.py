"""An experiment that the excitation is handed over: read, built, held against the limits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from idloop.documents import read_yaml
from idloop.errors import InputError
from idloop.signals import build_signal
from idloop.spelling import did_you_mean, listed

Array = NDArray[np.float64]

# What an experiment may add to, and the targets of an excitation node that do so.
ADDS_TO = {"command": ("effort",), "reference": ("reference", "position")}
FORM = "{signal: {name: multilevel, amplitude: 2.0, duration: 20.0}, adds_to: command}"


@dataclass(frozen=True)
class Limits:
    """What an experiment must keep within; None where nothing is declared."""

    amplitude: float | None = None  # largest absolute value of the signal
    # Of the axis; of a reference also before it moves
    position_min: float | None = None
    position_max: float | None = None
    velocity: float | None = None

    def refuse(self, experiment: Experiment) -> None:
        """Raise InputError when the signal itself exceeds a limit."""
        peak = float(np.max(np.abs(experiment.value)))
        if self.amplitude is not None and peak > self.amplitude * (1.0 + 1e-9):
            raise InputError(f"experiment: reaches {peak:.4g}, more than limit.amplitude {self.amplitude:.4g}")
        if experiment.adds_to != "reference":
            return
        low, high, speed = (float(f(experiment.value)) for f in (np.min, np.max, experiment.fastest))
        if self.position_min is not None and low < self.position_min:
            raise InputError(f"experiment: reaches {low:.4g}, below limit.position_min {self.position_min:.4g}")
        if self.position_max is not None and high > self.position_max:
            raise InputError(f"experiment: reaches {high:.4g}, above limit.position_max {self.position_max:.4g}")
        if self.velocity is not None and speed > self.velocity * (1.0 + 1e-9):
            raise InputError(f"experiment: moves at {speed:.4g}, faster than limit.velocity {self.velocity:.4g}")

    def breach(self, position: float, velocity: float) -> str:
        """Return which limit a measurement exceeds, empty when none; what is not measured is NaN."""
        if self.position_min is not None and position < self.position_min:
            return f"position {position:.4g} is below limit.position_min {self.position_min:.4g}"
        if self.position_max is not None and position > self.position_max:
            return f"position {position:.4g} is above limit.position_max {self.position_max:.4g}"
        if self.velocity is not None and abs(velocity) > self.velocity:
            return f"velocity {velocity:.4g} is beyond limit.velocity {self.velocity:.4g}"
        return ""

    @property
    def watched(self) -> bool:
        """Whether the axis itself has to be watched."""
        return any(one is not None for one in (self.position_min, self.position_max, self.velocity))


@dataclass(frozen=True)
class Experiment:
    """A signal to play once."""

    # shape (n,): samples and their time derivative per second
    value: Array
    rate: Array
    adds_to: str  # {"command", "reference"}
    sample_time: float  # seconds between samples

    def fastest(self, value: Array) -> float:
        """Return the largest rate of change of a signal on this grid."""
        return float(np.max(np.abs(np.diff(value)))) / self.sample_time if len(value) > 1 else 0.0


def read_experiment(text: str, target: str, sample_time: float) -> Experiment:
    """Read the YAML text of an experiment and build its signal.

    `text`: such as `FORM`; `target`: where the excitation node's samples go: ``reference``, ``position`` or ``effort``;
    `sample_time`: of the node [s]. Raises InputError: no such text, no such signal, or one that this node cannot play.
    """
    document = read_yaml(text, "experiment")
    if not isinstance(document, Mapping) or not isinstance(document.get("signal"), Mapping):
        raise InputError(f"experiment: write it as {FORM}")
    unknown = [str(key) for key in document if key not in ("signal", "adds_to")]
    if unknown:
        raise InputError(f"experiment: unknown key {unknown[0]}{did_you_mean(unknown[0], ('signal', 'adds_to'))}")
    adds_to = str(document.get("adds_to", next(key for key, targets in ADDS_TO.items() if target in targets)))
    if adds_to not in ADDS_TO:
        raise InputError(f"experiment: adds_to is {listed([adds_to])}; choose command or reference")
    if target not in ADDS_TO[adds_to]:
        raise InputError(f"experiment: adds to the {adds_to}, but the target of this node is {target}")
    signal: dict[str, Any] = {str(key): value for key, value in document["signal"].items()}
    if "name" not in signal:
        raise InputError(f"experiment: the signal has no name; write it as {FORM}")
    if signal.setdefault("sample_time", sample_time) != sample_time:
        raise InputError(
            f"experiment: its sample_time {listed([str(signal['sample_time'])])} s is not that of this node,"
            f" {sample_time:g} s"
        )
    built = build_signal(str(signal.pop("name")), **signal)
    rate = np.zeros_like(built.value) if built.rate is None else built.rate
    return Experiment(built.value, rate, adds_to, sample_time)
