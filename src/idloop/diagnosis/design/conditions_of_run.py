"""Where an experiment is to be run: the loop, the start, the limits."""

from __future__ import annotations

from dataclasses import dataclass

from idloop.diagnosis.design.designs import Design
from idloop.diagnosis.design.experiment import COMMAND, Experiment
from idloop.diagnosis.design.limits import Limits


@dataclass(frozen=True)
class Setup:
    """Where an experiment is to be run.

    Attributes
    ----------
    adds_to : str
    controller : dict or None
    start : float
        Position at rest before it [position unit].
    signal_time, sample_time : float
        Sample times of the signal and of the measurements [s].
    limits : Limits
        Completed.
    pace : float or None
        Largest rate of change of a reference, where the user has limited the velocity: what is followed must
        not ask for more.
    seed : int
    """

    adds_to: str
    controller: dict[str, object] | None
    start: float
    signal_time: float
    sample_time: float
    limits: Limits
    pace: float | None
    seed: int

    @property
    def room(self) -> tuple[float, float]:
        """Middle about which the signal acts, and its largest peak."""
        if self.adds_to == COMMAND:
            return 0.0, float(self.limits.command or 1.0)
        if self.limits.position is None:
            return 0.0, 1.0
        low, high = self.limits.position
        middle, half = 0.5 * (low + high) - self.start, 0.5 * (high - low)
        if abs(middle) < 0.3 * half:
            return 0.0, half - abs(middle)
        return middle, half

    def experiment(self, design: Design, level: float, duration: float) -> Experiment:
        """A design at a share of the largest peak."""
        about, peak = self.room
        ramp = 0.0 if self.adds_to == COMMAND else 0.05 * duration
        signal = design.signal(level * peak, self.signal_time, duration, ramp, about)
        signal["seed"] = int(signal["seed"]) + 100 * self.seed
        return Experiment(signal, self.adds_to, self.controller, self.start, self.sample_time)
