"""Search for the experiment within limits that best separates rivals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from idloop.diagnosis.design.designs import (
    Design,
    command_designs,
    machine_scale,
    neighbours,
    reference_designs,
    representatives,
)
from idloop.diagnosis.design.experiment import COMMAND, Experiment, Setup
from idloop.diagnosis.design.rival_set import experiment_gains, nested
from idloop.diagnosis.design.rivals import Rival
from idloop.diagnosis.options import Progress
from idloop.errors import IdloopError
from idloop.physics.kernel import RATE

Array = NDArray[np.float64]

# Shares of the largest level that the limits admit, for every design and for the best ones.
_FIRST_LEVELS, _FINER_LEVELS = (1.0, 0.4), (0.7, 0.2)
_LEAST_LEVEL = 0.02
# Designs that are tried at finer levels, and designs around which a local search begins, by round.
_FINALISTS, _LOCAL = 5, (2, 1)
# Cost of the search in seconds of a usual core; counted, not measured, so that equal calls give equal answers.
_BUDGET = 20.0
# Candidates of a full search; with fewer than the least the experiments become shorter.
_PLENTY, _LEAST = 100, 12
# A gain that is decisive.
_PLAIN = 100.0
# A gain beyond this counts as infinite.
_MOST_GAIN = 1e6
# Of experiments with this part of the best value the shorter and gentler one is taken.
_NEARLY = 0.9


@dataclass(frozen=True)
class Choice:
    """A candidate with its value."""

    design: Design
    level: float  # share of the largest peak
    duration: float  # [s]
    value: float  # by which candidates are ranked
    score: float  # expected log-likelihood difference of the closest two rivals
    gains: Array  # see `experiment_gains`, shape (m, m)


class Search:
    """Search of the family of designs, then around its best members.

    `duration` fixes the length [s]; with `against_first` every rival is compared with the first one only.
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
        self.nested = nested([rival.model for rival in rivals])
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
        found = self._coarse_levels()
        return self._confirmed(self._local_search(self._finer_levels(found))) if found else None

    def _coarse_levels(self) -> list[Choice]:
        found = []
        for index, design in enumerate(self.designs):
            self.report(0.6 * index / len(self.designs), design.name)
            most = self._largest_level(design, self.durations[0])
            if most is not None:
                found += self._at(design, [most * share for share in _FIRST_LEVELS], self.durations[0])
        return _ranked(found)

    def _finer_levels(self, found: list[Choice]) -> list[Choice]:
        more = []
        finalists = _distinct(found, max(round(_FINALISTS * self.share), 1))
        for index, choice in enumerate(finalists):
            self.report(0.6 + 0.15 * index / len(finalists), choice.design.name)
            top = max(c.level for c in found if c.design == choice.design)
            more += self._at(choice.design, [top * share for share in _FINER_LEVELS], choice.duration)
            for duration in self.durations[1:]:
                more += self._at(choice.design, [choice.level], duration)
        return _ranked(found + more)

    def _local_search(self, found: list[Choice]) -> list[Choice]:
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
        top = _ranked(confirmed)[0].value
        enough = [choice for choice in confirmed if choice.value >= _NEARLY * top]
        return min(enough, key=lambda choice: (choice.duration, choice.level, -choice.value))

    def _at(self, design: Design, levels: Sequence[float], duration: float) -> list[Choice]:
        found = []
        for level in levels:
            if not _LEAST_LEVEL <= level <= 1.0 + 1e-9:
                continue
            choice = self.evaluate(design, level, duration)
            if choice is not None:
                found.append(choice)
        return found

    def evaluate(self, design: Design, level: float, duration: float) -> Choice | None:
        """The value of a candidate; None when it exceeds the limits or cannot be built."""
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
        # An experiment that decides by itself does not depend on what the old data say of the parameters.
        value = float(np.sqrt((1.0 + joint) * (1.0 + min(self.score(alone), joint))) - 1.0)
        return Choice(design, level, duration, value, joint, gains)

    def score(self, gains: Array) -> float:
        """Expected log-likelihood difference of the closest two rivals.

        The geometric mean of the two cases of which one is right; of nested models only the case that can show.
        """
        if self.against_first:
            # Each counts up to a decisive gain, so that one large gain does not hide small ones.
            return float(np.expm1(np.mean(np.log1p(np.minimum(gains[1:, 0], _PLAIN)))))
        worst = _MOST_GAIN
        for i in range(len(gains)):
            for j in range(i):
                one, other = float(gains[i, j]), float(gains[j, i])
                if self.nested[i, j]:
                    pair = other
                elif self.nested[j, i]:
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
    return sorted(found, key=lambda choice: -choice.value)


def _distinct(found: list[Choice], count: int) -> list[Choice]:
    """The best ones of different designs."""
    kept: list[Choice] = []
    for choice in found:
        if len(kept) < count and all(choice.design != other.design for other in kept):
            kept.append(choice)
    return kept
