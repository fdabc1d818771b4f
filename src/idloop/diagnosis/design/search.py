"""The search for the experiment within limits that best separates rivals."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from idloop.diagnosis.design.conditions_of_run import Setup
from idloop.diagnosis.design.designs import (
    Design,
    command_designs,
    machine_scale,
    neighbours,
    reference_designs,
    representatives,
)
from idloop.diagnosis.design.experiment import COMMAND, Experiment
from idloop.diagnosis.design.rival_set import contained, experiment_gains
from idloop.diagnosis.design.rivals import Rival
from idloop.errors import IdloopError
from idloop.physics.kernel import RATE

if TYPE_CHECKING:
    pass

Array = NDArray[np.float64]
Progress = Callable[[float, str], None]

# Shares of the largest level that the limits admit, for every design and for the best ones.
_FIRST_LEVELS, _FINER_LEVELS = (1.0, 0.4), (0.7, 0.2)
_LEAST_LEVEL = 0.02
# How many designs are looked at more closely, and about how many of the best ones the search goes on.
_FINALISTS, _LOCAL = 5, (2, 1)
# What the search may cost, in seconds of a usual core. Counted, not measured: equal calls give equal answers.
_BUDGET = 20.0
# Candidates of a search without haste; fewer than the least are worth shorter experiments.
_PLENTY, _LEAST = 100, 12
# A gain that leaves no doubt.
_PLAIN = 100.0
# A gain beyond this is as good as infinite.
_MOST_GAIN = 1e6
# Of nearly equally good experiments the gentler and shorter one is taken.
_NEARLY = 0.9


@dataclass(frozen=True)
class Choice:
    """A candidate with what it is worth.

    Attributes
    ----------
    design : Design
    level : float
        Share of the largest peak.
    duration : float
        [s]
    worth : float
        What candidates are ranked by.
    score : float
        Expected log-likelihood difference of the closest two rivals.
    gains : ndarray (m, m)
        See `experiment_gains`.
    """

    design: Design
    level: float
    duration: float
    worth: float
    score: float
    gains: Array


class Search:
    """Looks through the family, then about its best members.

    Parameters
    ----------
    rivals : sequence of Rival
    setup : Setup
    duration : float, optional
        Fixed length [s].
    report : callable
        Share done and a few words.
    against_first : bool
        Tell every rival from the first one, not from each other.
    """

    def __init__(
        self,
        rivals: Sequence[Rival],
        setup: Setup,
        duration: float | None,
        report: Progress,
        *,
        against_first: bool = False,
    ) -> None:
        self.rivals, self.setup, self.report, self.against_first = list(rivals), setup, report, against_first
        self.contained = contained([rival.model for rival in rivals])
        scale = machine_scale(rivals[0].engine, setup.signal_time, duration)
        usual = float(np.ceil(np.clip(25.0 * scale.settling, 6.0, 20.0)))
        self.durations = [duration] if duration is not None else [usual, 0.5 * usual]
        affordable = _BUDGET / self._cost(self.durations[0])
        if affordable < _LEAST and duration is None:
            shorter = max(float(np.ceil(usual * affordable / _LEAST)), 0.25 * usual)
            self.durations = [shorter]
            affordable = _BUDGET / self._cost(shorter)
        family = command_designs if setup.adds_to == COMMAND else reference_designs
        self.highest = scale.highest
        self.share = float(np.clip(affordable / _PLENTY, 0.1, 1.0))
        self.designs = representatives(family(scale, setup.signal_time, self.durations[0]), self.share)

    def _cost(self, duration: float) -> float:
        """Seconds that one candidate takes on a usual core."""
        m, samples = len(self.rivals), duration / self.setup.sample_time
        total = 0.0
        for rival in self.rivals:
            layout = rival.engine.layout(None)
            steps = duration * max(float(layout.axis.constants[RATE]), 1.0 / self.setup.signal_time)
            run = (samples + steps) * (0.1 + 0.1 * layout.bodies)
            series = 1 + len(rival.theta)
            refits = series * run + 0.2 * samples * len(rival.model.outputs) * series
            total += 2.0 * run + (1 if self.against_first else m - 1) * refits
        return 1e-6 * total

    def best(self) -> Choice | None:
        """The best experiment; None when even the gentlest passes the limits."""
        found = self._first_look()
        if not found:
            return None
        found = self._closer_look(found)
        found = self._about_the_best(found)
        return self._confirmed(found)

    # -- the stages ------------------------------------------------------------------------

    def _first_look(self) -> list[Choice]:
        found = []
        for index, design in enumerate(self.designs):
            self.report(0.6 * index / len(self.designs), design.name)
            most = self._largest_level(design, self.durations[0])
            if most is not None:
                found += self._at(design, [most * share for share in _FIRST_LEVELS], self.durations[0])
        return _ranked(found)

    def _closer_look(self, found: list[Choice]) -> list[Choice]:
        more = []
        finalists = _distinct(found, max(round(_FINALISTS * self.share), 1))
        for index, choice in enumerate(finalists):
            self.report(0.6 + 0.15 * index / len(finalists), choice.design.name)
            top = max(c.level for c in found if c.design == choice.design)
            more += self._at(choice.design, [top * share for share in _FINER_LEVELS], choice.duration)
            for duration in self.durations[1:]:
                more += self._at(choice.design, [choice.level], duration)
        return _ranked(found + more)

    def _about_the_best(self, found: list[Choice]) -> list[Choice]:
        for round_, count in enumerate(_LOCAL):
            more = []
            for choice in _distinct(found, max(round(count * self.share), 1)):
                self.report(0.75 + 0.1 * round_, f"about {choice.design.name}")
                near = neighbours(choice.design, self.highest)
                near = [design for design in near if all(design != o.design for o in found)]
                for design in representatives(near, self.share):
                    more += self._at(design, [choice.level], choice.duration)
                if self.share == 1.0:
                    more += self._at(choice.design, [choice.level * f for f in (0.8, 1.25)], choice.duration)
            found = _ranked(found + more)
        return found

    def _confirmed(self, found: list[Choice]) -> Choice:
        """The best few again, the rivals refitted by a search instead of one linear step."""
        confirmed = []
        for index, choice in enumerate(found[: max(round(3 * self.share), 1)]):
            self.report(0.92 + 0.02 * index, "refitting the rivals")
            experiment = self.setup.experiment(choice.design, choice.level, choice.duration)
            confirmed.append(self._judged(choice.design, choice.level, choice.duration, experiment, searched=True))
        top = _ranked(confirmed)[0].worth
        enough = [choice for choice in confirmed if choice.worth >= _NEARLY * top]
        return min(enough, key=lambda choice: (choice.duration, choice.level, -choice.worth))

    # -- one candidate ---------------------------------------------------------------------

    def _at(self, design: Design, levels: Sequence[float], duration: float) -> list[Choice]:
        found = []
        for level in levels:
            if not _LEAST_LEVEL <= level <= 1.0 + 1e-9:
                continue
            choice = self.weigh(design, level, duration)
            if choice is not None:
                found.append(choice)
        return found

    def weigh(self, design: Design, level: float, duration: float) -> Choice | None:
        """What a candidate is worth; None when it passes the limits or cannot be built."""
        try:
            experiment = self.setup.experiment(design, level, duration)
            if self._excess(experiment) > 1.0:
                return None
            return self._judged(design, level, duration, experiment, searched=False)
        except (IdloopError, np.linalg.LinAlgError):
            return None

    def _judged(
        self, design: Design, level: float, duration: float, experiment: Experiment, *, searched: bool
    ) -> Choice:
        found = experiment_gains(self.rivals, experiment, searched=searched, against_first=self.against_first)
        gains, alone = (np.minimum(g, _MOST_GAIN) for g in found)
        joint = self.score(gains)
        # An experiment that decides by itself does not hang on how well the old data fix the parameters.
        worth = float(np.sqrt((1.0 + joint) * (1.0 + min(self.score(alone), joint))) - 1.0)
        return Choice(design, level, duration, worth, joint, gains)

    def score(self, gains: Array) -> float:
        """Expected log-likelihood difference of the closest two rivals.

        Which of the two is right is not known, so the geometric mean of both cases counts; of a model and
        one that contains it only the case that can show.
        """
        if self.against_first:
            # Each counts up to where it is plain, so that what cannot show does not keep the others from showing.
            return float(np.expm1(np.mean(np.log1p(np.minimum(gains[1:, 0], _PLAIN)))))
        worst = _MOST_GAIN
        for i in range(len(gains)):
            for j in range(i):
                one, other = float(gains[i, j]), float(gains[j, i])
                if self.contained[i, j]:
                    pair = other
                elif self.contained[j, i]:
                    pair = one
                else:
                    pair = float(np.sqrt((1.0 + one) * (1.0 + other)) - 1.0)
                worst = min(worst, pair)
        return worst

    def _excess(self, experiment: Experiment) -> float:
        limits, pace = self.setup.limits, self.setup.pace
        if pace is not None:
            steepest = float(np.max(np.abs(np.diff(experiment.built.value)))) / experiment.built.sample_time
            if steepest > pace:
                return steepest / pace
        return max(limits.excess(r.model, experiment.run(r.model, engine=r.engine)) for r in self.rivals)

    def _largest_level(self, design: Design, duration: float) -> float | None:
        """Largest share of the peak at which every rival stays inside the limits."""
        level, beyond = 1.0, None
        while level >= _LEAST_LEVEL:
            try:
                excess = self._excess(self.setup.experiment(design, level, duration))
            except IdloopError:
                return None
            if excess <= 1.0:
                break
            beyond = level
            level *= float(np.clip(0.95 / excess, 0.3, 0.8)) if np.isfinite(excess) else 0.3
        else:
            return None
        if beyond is not None and beyond > 1.3 * level:
            middle = 0.5 * (level + beyond)
            if self._excess(self.setup.experiment(design, middle, duration)) <= 1.0:
                level = middle
        return level


def _ranked(found: list[Choice]) -> list[Choice]:
    return sorted(found, key=lambda choice: -choice.worth)


def _distinct(found: list[Choice], count: int) -> list[Choice]:
    """The best ones of different designs."""
    kept: list[Choice] = []
    for choice in found:
        if len(kept) < count and all(choice.design != other.design for other in kept):
            kept.append(choice)
    return kept
