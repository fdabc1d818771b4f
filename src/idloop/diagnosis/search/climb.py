"""Climb a ladder in one view of the data: evaluate, add the best, remove what is superfluous, until nothing shows."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from typing import Generic

from idloop.diagnosis.candidate import effect_parameters
from idloop.diagnosis.diagnosis import candidate_of, first_of_pair, rival_pairs, step_ending, tied_members
from idloop.diagnosis.evidence.undetermined_strength import undetermined_with
from idloop.diagnosis.ladder import Ladder, Step
from idloop.diagnosis.options import SIMULATION, Progress
from idloop.diagnosis.search.step import MISSING, FitT, SearchStep, View
from idloop.physics.model import Model
from idloop.records import Record

# Most choices of one step that are fitted to all samples.
_MOST_CHOICES = 3


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
    reduces: bool = False  # whether effects of the given ladder may be superfluous in this view

    def __call__(self, fit: FitT, ladder: Ladder | None = None) -> tuple[Ladder, FitT]:
        """Climb from a fitted model, on from a ladder where one is given, to the fit of the last model."""
        kept, added, refused, timing_refused = set[str](), set[str](), set[str](), False
        if ladder is not None and self.reduces:
            # What another view has found may be superfluous in this one.
            ladder, fit = self._without_superfluous(ladder, fit, kept, ladder.steps[1:])
        while True:
            count = 0 if ladder is None else len(ladder.added)
            begin, end = count / (count + 2.0), (count + 1.0) / (count + 3.0)
            self.report(begin, f"evaluating effects beside {count}" if count else "evaluating effects")
            step = self.view.within(begin, end).evaluate(fit)
            fit = step.parent
            if ladder is None:
                model = step.reported(fit)
                ladder = Ladder((Step(None, model).measured(model, self.records, self.validation),))
            ladder = replace(ladder, criterion=self.criterion, level=self.level)
            room = bool(step.tied) and count + len(step.tied[0].proposals) <= self.most
            # A missing effect may hide the timing of the command: it is looked at again once effects were added.
            timed = self.view.with_timing(step) if (added or room) and not timing_refused else None
            if timed is not None:
                view, after = timed[0], step.reported(timed[1])
                timing_refused = self.worse is not None and self.worse(ladder.model, after)
                if not timing_refused:
                    return replace(self, view=view)(timed[1], self._with_values(ladder, after))
            step, found = self._first_that_serves(step, ladder.model) if room else (step, None)
            if found is None:
                other = self._with_another_of_a_tie(ladder, fit, refused) if count < self.most else None
                if other is None:
                    break
                ladder, fit = other
                continue
            steps, fit = found
            for one in steps:
                ladder = self._with(ladder, one, fit)
            # An effect that was removed and has come back is kept, or the ladder could cycle.
            names = set(step.tied[0].names)
            kept, added = kept | (names & added), added | names
            earlier = [one for one in ladder.steps[1:] if one.added is None or one.added.name not in names]
            ladder, fit = self._without_superfluous(ladder, fit, kept, earlier)
            if self.on_step is not None:
                self.on_step(ladder)
        return self._concluded(ladder, step), fit

    def _first_that_serves(
        self, step: SearchStep[FitT], before: Model
    ) -> tuple[SearchStep[FitT], tuple[list[Step], FitT] | None]:
        """The best choice that makes no other view worse and that the data determine, fitted to all samples.

        With the step that refuses the others; None where there is none.
        """
        for _ in range(_MOST_CHOICES):
            if not step.tied:
                return step, None
            steps, fit = self._steps(step)
            why = self._refusal(before, steps[-1].model, step)
            if not why:
                return step, (steps, fit)
            step = replace(step, rejected={**step.rejected, step.tied[0].names[-1]: why})
        # No other choice is asked for.
        names = {one.names[-1]: why for one in step.tied}
        return replace(step, rejected={**step.rejected, **names}), None

    def _refusal(self, before: Model, after: Model, step: SearchStep[FitT]) -> str:
        """Why the best choice of a step is not added; empty where it is."""
        if self.worse is not None and self.worse(before, after):
            return "with it the model explains less of the records"
        if step.criterion == SIMULATION:
            # Errors of a free run are model errors, beside which a standard error says little.
            return ""
        return next(filter(None, (undetermined_with(before, after, one) for one in step.tied[0].proposals)), "")

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

    def _with_another_of_a_tie(self, ladder: Ladder, fit: FitT, refused: set[str]) -> tuple[Ladder, FitT] | None:
        """The ladder and its fit with another effect of a tie, beside which more is found; None without one.

        Of effects that do the same alone, one may hide what another leaves visible: a friction that depends on the
        force of the drive shows beside a load on the axis, not beside an offset of the command. Each is tried once;
        their names are added to `refused`.
        """
        if not self.view.leaves_model_error(fit):
            return None
        for place, step in enumerate(ladder.steps):
            before = step.added
            if before is None or step.chosen_by == "user" or before.name not in fit.model.effect_names:
                continue
            for name in (name for name in step.set if name not in {before.name, *refused}):
                refused.update((name, before.name))
                other = self.view.exchanged(fit, before.name, name)
                if other is None or not self.view.evaluate(other).tied:
                    continue
                model = self.view.reported(other)
                active = next(one for one in model.effects if one.name == name)
                added = replace(before, effect=active.effect.name, at=active.at, text=active.effect.text, number=1)
                swapped = replace(step, added=added.with_model(model))
                shown = self._refitted([swapped, *ladder.steps[place + 1 :]], model, other)
                return replace(ladder, steps=(*ladder.steps[:place], *shown)), other
        return None

    def _with(self, ladder: Ladder, step: Step, fit: FitT) -> Ladder:
        """The ladder with one more step; an effect that replaces another one takes its place.

        The steps in between then have it as well, so that each shows what its own effect explains.
        """
        replaced = None if step.added is None else step.added.replaces
        own = [one.added is not None and one.added.name == replaced for one in ladder.steps]
        if replaced is None or not any(own) or ladder.steps[own.index(True)].chosen_by == "user":
            step = step.measured(step.model, self.records, self.validation)
            return replace(ladder, steps=(*ladder.steps, step), verdict=MISSING)
        place = own.index(True)
        shown = self._refitted([step, *ladder.steps[place + 1 :]], step.model, fit)
        return replace(ladder, steps=(*ladder.steps[:place], *shown), verdict=MISSING)

    def _refitted(self, steps: Sequence[Step], last: Model, fit: FitT) -> list[Step]:
        """Some steps up to the last model, each fitted again without the effects of those that follow it."""
        found = []
        for place, one in enumerate(steps, start=1):
            later = [other.added.name for other in steps[place:] if other.added is not None]
            model = last if not later else self.view.refitted(last.without_effects(later), fit) or one.model
            found.append(one.measured(model, self.records, self.validation))
        return found

    def _without_superfluous(
        self, ladder: Ladder, fit: FitT, kept: Collection[str], steps: Sequence[Step]
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
            model = self.view.reported(without)
            if self.worse is not None and self.worse(ladder.model, model):
                continue
            fit = without
            names = [None if one.added is None else one.added.name for one in ladder.steps]
            place = names.index(gone.name)
            left = (*ladder.steps[:place], *self._refitted(ladder.steps[place + 1 :], model, fit))
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
