"""Climb a ladder in one view of the data: weigh, add the best, take out what is needless, until nothing shows."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from typing import Generic

from idloop.diagnosis.candidate import Candidate, Rung, effect_parameters
from idloop.diagnosis.diagnosis import candidate_of, first_of_pair, rival_pairs, step_ending, tied_members
from idloop.diagnosis.ladder import Ladder
from idloop.diagnosis.ladder import Step as LadderStep
from idloop.diagnosis.model_errors import model_errors
from idloop.diagnosis.search.step import MISSING, FitT, Step, View
from idloop.physics.model import Model
from idloop.records import Record


@dataclass(frozen=True)
class Climb(Generic[FitT]):
    """What does not change while a ladder grows."""

    view: View[FitT]
    records: Sequence[Record]  # what is fitted
    validation: Sequence[Record]  # what the fit does not see
    criterion: str  # what the models are measured by
    level: float  # family-wise error rate of every step
    most: int  # most effects to add
    tell: Callable[[float, str], None]
    on_step: Callable[[Ladder], None] | None = None
    spoils: Callable[[Model, Model], bool] | None = None  # the second model must not take the place of the first

    def __call__(self, fit: FitT, ladder: Ladder | None = None) -> tuple[Ladder, FitT]:
        """Climb from a fitted model, on from a ladder where one is given, to the fit of the last model."""
        given, spoilt = ladder, False
        stays, seen, looked = set[str](), set[str](), False
        step: Step[FitT] | None = None
        while True:
            count = 0 if ladder is None else len(ladder.added)
            self.tell(count / (count + 2.0), f"weighing effects beside {count}" if count else "weighing effects")
            step = self.view.weigh(fit)
            fit = step.parent
            if ladder is None:
                ladder = Ladder((self._rise(None, step.reported(fit)),))
            ladder = replace(ladder, criterion=self.criterion, level=self.level)
            if given is not None and self.spoils is not None and not looked:
                # What another view has found may be needless in this one.
                looked, before = True, ladder
                ladder, fit = self._without_needless(ladder, fit, step, stays, ladder.steps[1:])
                if ladder is not before:
                    continue
            if not step.tied or count + len(step.tied[0].proposals) > self.most:
                break
            rungs, further = self._taken(step)
            if self.spoils is not None and self.spoils(ladder.model, rungs[-1].added.model or ladder.model):
                spoilt = True
                break
            fit = further
            for rung in rungs:
                ladder = self._with(ladder, rung)
            # What was taken out and has come back stays, or a ladder could turn in a circle.
            names = set(step.tied[0].names)
            stays, seen = stays | (names & seen), seen | names
            ladder, fit = self._without_needless(ladder, fit, step, stays, ladder.steps[1:-1])
            if self.on_step is not None:
                self.on_step(ladder)
        self.tell(1.0, "done")
        if spoilt and given is not None:
            # What the other view says of the machine stands.
            return (given if len(ladder.steps) == len(given.steps) else replace(ladder, verdict=given.verdict)), fit
        return self._concluded(ladder, step), fit

    def _taken(self, step: Step[FitT]) -> tuple[list[Rung], FitT]:
        """What the best choice of a step adds, one effect after the other, and the model that has it all."""
        best = step.tied[0]
        fit = self.view.again(best.fit)
        last = candidate_of(step, best, -1, step.reported(fit))
        if len(best.proposals) == 1:
            return [Rung(last, step.names)], fit
        first, second = best.names
        tied = tied_members(second, first, rival_pairs(step))
        return [Rung(first_of_pair(step, best), (first,)), Rung(last, tied)], fit

    def _with(self, ladder: Ladder, rung: Rung) -> Ladder:
        """The ladder with one more rung; what its effect takes the place of is no rung of its own any more."""
        added = rung.added
        steps = [s for s in ladder.steps if s.added is None or s.added.name != added.replaces or s.chosen_by == "user"]
        if added.model is None:
            return ladder
        step = replace(self._rise(added, added.model), set=rung.set, p_value=added.p_value)
        return replace(ladder, steps=(*steps, step), verdict=MISSING)

    def _rise(self, added: Candidate | None, model: Model) -> LadderStep:
        return LadderStep(
            added, model, train=model_errors(model, self.records), validation=model_errors(model, self.validation)
        )

    def _without_needless(
        self, ladder: Ladder, fit: FitT, step: Step[FitT], stays: Collection[str], steps: Sequence[LadderStep]
    ) -> tuple[Ladder, FitT]:
        """Take effects of some steps out again that others have made superfluous."""
        for earlier in steps:
            gone = earlier.added
            there = gone is not None and gone.name in fit.model.effect_names
            if gone is None or not there or earlier.chosen_by == "user" or gone.name in stays:
                continue
            without = self.view.without(fit, gone.name)
            if without is None:
                continue
            model = step.reported(without)
            if self.spoils is not None and self.spoils(ladder.model, model):
                continue
            fit = without
            *others, last = (one for one in ladder.steps if one is not earlier)
            added = None
            if last.added is not None:
                added = replace(last.added, model=model, parameters=effect_parameters(model, last.added.name))
            ladder = replace(
                ladder, steps=(*others, replace(self._rise(added, model), set=last.set, p_value=last.p_value))
            )
        return ladder, fit

    def _concluded(self, ladder: Ladder, step: Step[FitT]) -> Ladder:
        shown = {*ladder.added, *step.passed_over}
        untestable = tuple(name for name in step.gate.untestable if name not in shown)
        return replace(ladder, untestable=untestable, limits=step.gate.limits, **step_ending(step))
