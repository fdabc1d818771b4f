"""Row B3: the controllers of the torsion thesis, their law and what they do to the machine."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from papers import Progress
from papers.claim import above, at_most, below, between
from papers.reproduction import Line, Reproduction, Table
from papers.torsion import torsion_thesis as thesis

if TYPE_CHECKING:
    from idloop.records import Record

Array = NDArray[np.float64]

PID, PD, NO_DERIVATIVE, PID_BARE, PD_BARE = (
    "PID", "PD", "PI, derivative removed", "PID, uncompensated", "PD, uncompensated"
)  # fmt: skip
# Step of the reference [deg], when [s], and length of the experiment [s].
STEP, BEGINS, LENGTH = 20.0, 0.5, 60.0
_SETTLED = 5.0


@dataclass(frozen=True, eq=False)
class StepOfLoop:
    """Motion of a loop, from a step of the reference if nothing else is said.

    Attributes
    ----------
    name : str
    time : ndarray, shape (n,)
        [s]
    angle : ndarray, shape (n,)
        Of the motor [deg].
    command : ndarray, shape (n,)
        Control signal.
    """

    name: str
    time: Array
    angle: Array
    command: Array

    @property
    def left(self) -> float:
        """Error at the end, mean of the last seconds [deg]."""
        return float(STEP - np.mean(self.angle[self.time > self.time[-1] - _SETTLED]))

    @property
    def swing(self) -> float:
        """Deviation of the angle in the last seconds [deg]."""
        return float(np.std(self.angle[self.time > self.time[-1] - _SETTLED]))

    @property
    def overshoot(self) -> float:
        """Of the largest angle over where it ends [%]."""
        return float(100.0 * (np.max(self.angle) / (STEP - self.left) - 1.0))


@dataclass(frozen=True, eq=False)
class TorsionControllers(Reproduction):
    """Law and behaviour of the thesis's controllers.

    Attributes
    ----------
    law_error : float
        Largest difference of our PID from eq. 4.2 on a recorded experiment without the limit [A].
    steps : dict of str to StepOfLoop
    prbs : dict of str to StepOfLoop
        The same loops under the thesis's PRBS.
    """

    law_error: float
    steps: Mapping[str, StepOfLoop]
    prbs: Mapping[str, StepOfLoop]

    @property
    def limited(self) -> dict[str, float]:
        """Share of the samples at the limit under the PRBS [%]."""
        return {
            name: float(100.0 * np.mean(np.abs(one.command) >= thesis.LIMIT * (1.0 - 1e-9)))
            for name, one in self.prbs.items()
        }

    def rows(self) -> tuple[Line, ...]:
        """The law, the limit, and what removing parts does."""
        s = self.steps
        most = max(float(np.max(np.abs(one.command))) for one in (*s.values(), *self.prbs.values()))
        lines = [
            Line("PID against eq. 4.2: largest difference of the command", self.law_error, 0.0, "A", "eq. 4.2",
                 below(1e-9)),
            Line("largest control signal of all loops", most, thesis.LIMIT, "", "section 4.3.2",
                 at_most(thesis.LIMIT * (1.0 + 1e-12))),
            Line("PID: swing at the end", s[PID].swing, "stable", "deg", "section 4.3.1", below(0.1)),
            Line("PD: swing at the end", s[PD].swing, "stable", "deg", "section 4.3.1", below(0.1)),
            Line("PID: overshoot of the step", s[PID].overshoot, None, "%", "section 5.5", below(10.0)),
            Line("derivative removed: overshoot of the step", s[NO_DERIVATIVE].overshoot, "oscillates too much", "%",
                 "section 5.5", above(30.0)),
            Line("PID, PRBS of 90 %: samples at the limit", self.limited[PID], "hardly", "%", "section 5.3",
                 below(5.0)),
            Line("derivative removed, the same: samples at the limit", self.limited[NO_DERIVATIVE], "gets saturated",
                 "%", "section 5.5", above(2.0 * self.limited[PID])),
            Line("PID: error left", s[PID].left, None, "deg", ""),
            Line("PD: error left", s[PD].left, None, "deg", ""),
        ]  # fmt: skip
        gap = s[PD].left - s[PD_BARE].left
        expected = float(np.degrees(thesis.CURRENT_OFFSET / thesis.KP))
        lines.append(
            Line("PD: what the offset of the input adds to the angle, at most offset / Kp", gap, expected, "deg",
                 "eq. 4.1, 4.2", between(0.0, 1.1 * expected))
        )  # fmt: skip
        return tuple(lines)

    def tables(self) -> tuple[Table, ...]:
        """Every loop's step."""
        header = ("loop", "error left [deg]", "swing at the end [deg]", "overshoot [%]", "PRBS: at the limit [%]")
        rows = [
            (n, one.left, one.swing, one.overshoot, self.limited[n]) for n, one in self.steps.items()
        ]  # fmt: skip
        return (Table(f"Step of {STEP:g}° on the simulated machine", header, rows),)

    def notes(self) -> tuple[str, ...]:
        """What is ours."""
        return (
            (
                "The machine: current gain and offset of figure 2.3, encoders that count, friction and imbalance of our"
                f" size ({1000.0 * thesis.FRICTION:g} and {1000.0 * thesis.IMBALANCE:g} mN·m at the motor). The"
                " controller reads the motor's angle, which the thesis does not say."
            ),
            (
                "The law is taken as a current and divided by 2.44; without compensation only the offset stays in, so"
                " that the loop is the same. The derivative has a low-pass of 5 ms: without one the encoder's counts"
                " alone fill the limit."
            ),
            "Friction holds the motor short of its reference; the integral of the PID is slow and needs minutes.",
        )

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        steps = {
            name: {"error_left": one.left, "swing": one.swing, "overshoot": one.overshoot}
            for name, one in self.steps.items()
        }
        return {**super().to_dict(), "steps": steps, "limited": self.limited}

    def plot(self, axes: Any = None) -> Any:
        """Draw angle and command after the step; returns the two matplotlib axes."""
        import matplotlib.pyplot as plt

        from idloop import drawing

        with drawing.styled():
            if axes is None:
                _, axes = plt.subplots(2, 1, sharex=True, figsize=(8, 5), layout="constrained")
            for index, name in enumerate((PID, PD, NO_DERIVATIVE)):
                one = self.steps[name]
                shown = one.time <= 3.0
                axes[0].plot(one.time[shown], one.angle[shown], label=name, **drawing.model_look(index))
                axes[1].plot(one.time[shown], one.command[shown], **drawing.model_look(index))
            axes[0].axhline(STEP, color=drawing.BAND, linewidth=0.8)
            axes[0].set_ylabel(drawing.label("motor angle", "deg"))
            axes[0].legend()
            axes[1].set_ylabel(drawing.label("control signal", "-"))
            axes[1].set_xlabel(drawing.label("time", "s"))
        return axes


def law_of(record: Record, wanted: Array) -> Array:
    """Eq. 4.2 in amperes: the integral a sum up to the sample before, the derivative a filtered difference."""
    from scipy.signal import lfilter

    every, over = thesis.MEASURED_EVERY, thesis.DERIVATIVE_FILTER
    angle = record.output[:, 0]
    error = wanted - angle
    integral = np.concatenate([[0.0], every * np.cumsum(error)[:-1]])
    change = np.concatenate([[0.0], np.diff(angle)]) / (over + every)
    derivative = lfilter([1.0], [1.0, -over / (over + every)], change)
    return np.asarray(thesis.KP * error + thesis.KI * integral - thesis.KD * derivative, dtype=float)


def reproduce(seed: int, progress: Progress, length: float = LENGTH) -> TorsionControllers:
    """Check the law on an experiment, then step every loop.

    Parameters
    ----------
    seed : int
        Of the experiment that checks the law.
    progress : callable
    length : float
        Of the steps [s], 10 or more.
    """
    progress(0.0, "law")
    wanted = thesis.excitation("prbs", np.radians(thesis.PRBS_LEVEL), thesis.BAND, seed + 1, 10.0)
    free = thesis.in_loop(thesis.quanser(), thesis.controller("pid", current=False), wanted)
    law_error = float(np.max(np.abs(free.input - law_of(free, wanted))))
    time = np.arange(round(length / thesis.MEASURED_EVERY)) * thesis.MEASURED_EVERY
    step = np.where(time >= BEGINS, np.radians(STEP), 0.0)
    machine = thesis.machine()
    sections = {
        PID: thesis.controller("pid", limit=thesis.LIMIT),
        PD: thesis.controller("pd", limit=thesis.LIMIT),
        NO_DERIVATIVE: {**thesis.controller("pid", limit=thesis.LIMIT), "kd": 0.0},
        PID_BARE: thesis.controller("pid", limit=thesis.LIMIT),
        PD_BARE: thesis.controller("pd", limit=thesis.LIMIT),
    }
    prbs = thesis.reference(thesis.CHOSEN, seed + 1, min(length, 20.0))
    steps: dict[str, StepOfLoop] = {}
    driven: dict[str, StepOfLoop] = {}
    for index, (name, section) in enumerate(sections.items()):
        progress(0.2 + 0.8 * index / len(sections), name)
        for kept, path in ((steps, step), (driven, prbs)):
            record = thesis.in_loop(machine, section, path, compensated=name not in (PID_BARE, PD_BARE))
            kept[name] = StepOfLoop(name, record.time, np.degrees(record.output[:, 0]), record.input)
    return TorsionControllers(law_error, steps, driven)
