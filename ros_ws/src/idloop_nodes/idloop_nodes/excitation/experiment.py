"""An experiment that the excitation is handed over: read, built, held against the limits while it plays."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from idloop.documents import read_yaml
from idloop.errors import InputError
from idloop.signals import SIGNALS, build_signal
from idloop.spelling import did_you_mean, listed
from idloop_nodes.codec import CdrError, JointReader
from idloop_nodes.parameters import Values
from idloop_nodes.streams.held_stream import PolledStream

LIMITS = ("amplitude", "position_min", "position_max", "velocity")
COMMON = ("sample_time", "duration", "amplitude", "offset", "seed", "ramp_in")

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


class AxisGuard:
    """Compares the measurements during an experiment with its limits."""

    def __init__(self, poll_topic: Callable[[str], PolledStream], joint: str) -> None:
        self._poll_topic = poll_topic
        self._reader = JointReader([(joint, "position"), (joint, "velocity")])
        self._measurements: PolledStream | None = None

    def prepare(self, limits: Limits) -> None:
        """Subscribe to the measurements as soon as a limit needs them."""
        if limits.watched and self._measurements is None:
            self._measurements = self._poll_topic("joint_states")

    def breach(self, limits: Limits, span: tuple[int, int] | None) -> str:
        """Take in what has arrived; return which limit was exceeded in the span of an experiment, empty when none."""
        if self._measurements is None:
            return ""
        found = ""
        for data, _ in self._measurements.take():
            if span is None or found:
                continue
            try:
                stamp, (position, velocity) = self._reader.read(data)
            except CdrError:
                continue
            if span[0] <= stamp < span[1]:
                found = limits.breach(position, velocity)
        return found


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
