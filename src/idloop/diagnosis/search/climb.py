"""Climb a ladder in one view of the data: evaluate, add the best, remove what is superfluous, until nothing shows."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from typing import Generic

from idloop.diagnosis.candidate import effect_parameters
from idloop.diagnosis.diagnosis import candidate_of, first_of_pair, rival_pairs, step_ending, tied_members
from idloop.diagnosis.ladder import Ladder, Step
from idloop.diagnosis.options import Progress
from idloop.diagnosis.search.step import MISSING, FitT, SearchStep, View
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
    report: Progress
    on_step: Callable[[Ladder], None] | None = None
    worse: Callable[[Model, Model], bool] | None = None  # whether the second model must not replace the first

    def __call__(self, fit: FitT, ladder: Ladder | None = None) -> tuple[Ladder, FitT]:
        """Climb from a fitted model, on from a ladder where one is given, to the fit of the last model."""
        given, rejected = ladder, False
        kept, added, reduced = set[str](), set[str](), False
        while True:
            count = 0 if ladder is None else len(ladder.added)
            self.report(count / (count + 2.0), f"evaluating effects beside {count}" if count else "evaluating effects")
            step = self.view.evaluate(fit)
            fit = step.parent
            if ladder is None:
                model = step.reported(fit)
                ladder = Ladder((Step(None, model).measured(model, self.records, self.validation),))
            ladder = replace(ladder, criterion=self.criterion, level=self.level)
            if given is not None and self.worse is not None and not reduced:
                # What another view has found may be superfluous in this one.
                reduced, before = True, ladder
                ladder, fit = self._without_superfluous(ladder, fit, step, kept, ladder.steps[1:])
                if ladder is not before:
                    continue
            ended = not step.tied or count + len(step.tied[0].proposals) > self.most
            # A missing effect may hide the timing of the command: it is looked at again once effects were added.
            timed = self.view.with_timing(step) if added or not ended else None
            if timed is not None:
                view, fit = timed
                return replace(self, view=view)(fit, self._with_values(ladder, step.reported(fit)))
            if ended:
                break
            steps, further = self._steps(step)
            if self.worse is not None and self.worse(ladder.model, steps[-1].model):
                rejected = True
                break
            fit = further
            for one in steps:
                ladder = self._with(ladder, one)
            # An effect that was removed and has come back is kept, or the ladder could cycle.
            names = set(step.tied[0].names)
            kept, added = kept | (names & added), added | names
            ladder, fit = self._without_superfluous(ladder, fit, step, kept, ladder.steps[1:-1])
            if self.on_step is not None:
                self.on_step(ladder)
        self.report(1.0, "done")
        if rejected and given is not None:
            # The verdict of the other view holds.
            return (given if len(ladder.steps) == len(given.steps) else replace(ladder, verdict=given.verdict)), fit
        return self._concluded(ladder, step), fit

    def _steps(self, step: SearchStep[FitT]) -> tuple[list[Step], FitT]:
        """What the best choice of a step adds, one effect after the other, and the model that has it all."""
        best = step.tied[0]
        fit = self.view.refit_thoroughly(best.fit)
        model = step.reported(fit)
        last = candidate_of(step, best, -1, model)
        if len(best.proposals) == 1:
            return [Step(last, model, step.names, last.p_value)], fit
        first = first_of_pair(step, best)
        tied = tied_members(best.names[1], best.names[0], rival_pairs(step))
        return [
            Step(first, first.model or model, best.names[:1], first.p_value),
            Step(last, model, tied, last.p_value),
        ], fit

    def _with(self, ladder: Ladder, step: Step) -> Ladder:
        """The ladder with one more step; an effect that the new one replaces is no step of its own any more."""
        replaced = None if step.added is None else step.added.replaces
        steps = [s for s in ladder.steps if s.added is None or s.added.name != replaced or s.chosen_by == "user"]
        step = step.measured(step.model, self.records, self.validation)
        return replace(ladder, steps=(*steps, step), verdict=MISSING)

    def _without_superfluous(
        self, ladder: Ladder, fit: FitT, step: SearchStep[FitT], kept: Collection[str], steps: Sequence[Step]
    ) -> tuple[Ladder, FitT]:
        """Remove effects of some steps that others have made superfluous."""
        for earlier in steps:
            gone = earlier.added
            there = gone is not None and gone.name in fit.model.effect_names
            if gone is None or not there or earlier.chosen_by == "user" or gone.name in kept:
                continue
            without = self.view.without(fit, gone.name)
            if without is None:
                continue
            model = step.reported(without)
            if self.worse is not None and self.worse(ladder.model, model):
                continue
            fit = without
            left = tuple(one for one in ladder.steps if one.added is None or one.added.name != gone.name)
            ladder = self._with_values(replace(ladder, steps=left), model)
        return ladder, fit

    def _with_values(self, ladder: Ladder, model: Model) -> Ladder:
        """The ladder with other values of its last model."""
        *others, last = ladder.steps
        if last.added is not None:
            parameters = effect_parameters(model, last.added.name)
            last = replace(last, added=replace(last.added, model=model, parameters=parameters))
        return replace(ladder, steps=(*others, last.measured(model, self.records, self.validation)))

    def _concluded(self, ladder: Ladder, step: SearchStep[FitT]) -> Ladder:
        shown = {*ladder.added, *step.passed_over}
        untestable = tuple(name for name in step.gate.untestable if name not in shown)
        return replace(ladder, untestable=untestable, limits=step.gate.limits, **step_ending(step))
