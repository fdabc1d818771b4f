"""Climb the ladder: diagnose, add, refit, until nothing significant is left."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from idloop.diagnose.candidate import Candidate, Rung, effect_parameters
from idloop.diagnose.choice import FORCE, MINIMUM_IMPROVEMENT, PREDICTION, check_numbers, first_kind
from idloop.diagnose.common_noise import with_common_whitening
from idloop.diagnose.diagnosis import diagnose_fitted
from idloop.diagnose.errors import model_errors
from idloop.diagnose.follows import unmoved
from idloop.diagnose.force_ladder import (
    NOTHING,
    ForceClimb,
    against_the_command,
    fitted_by_force,
    fitted_model,
    needs_balance,
)
from idloop.diagnose.force_search import ForceSearch
from idloop.diagnose.intervals import with_stderr
from idloop.diagnose.ladder import Ladder, Step
from idloop.diagnose.lattice import quantised
from idloop.diagnose.leap import leap
from idloop.diagnose.parallel import in_parallel
from idloop.diagnose.proposals import proposals
from idloop.diagnose.refit import Refit, refit, refit_or_none
from idloop.diagnose.restarts import has_contacts, searched_anew
from idloop.diagnose.setting import Setting, prepare_setting
from idloop.diagnose.verdict import MISSING
from idloop.estimate.dataset import prepare
from idloop.estimate.direction import turned
from idloop.estimate.engine import RememberingEngine
from idloop.estimate.undetermined import common_scale, effect_scales
from idloop.physics.effect_text import parse_effect
from idloop.physics.model import Model
from idloop.records import Record

Progress = Callable[[float, str], None]

# An earlier effect goes when the model without it loses less log-likelihood than this.
_NEEDLESS = 4.0
# What raises the unexplained force by a tenth is not what was missing: parameters make up for it.
_SPOILT = 1.1


@np.errstate(over="ignore", invalid="ignore", divide="ignore")
def refine(
    model: Model,
    records: Sequence[Record],
    validation: Sequence[Record] = (),
    *,
    level: float = 0.01,
    criterion: str = "auto",
    minimum_improvement: float = MINIMUM_IMPROVEMENT,
    effects: Sequence[str] | None = None,
    seed: int = 0,
    most: int = 8,
    ladder: Ladder | None = None,
    progress: Progress | None = None,
    on_step: Callable[[Ladder], None] | None = None,
) -> Ladder:
    """Add the missing effects one by one, or two that show only together, until nothing significant is left.

    Parameters
    ----------
    model : Model
    records, validation : sequence of Record
        What is fitted, and what the fit does not see.
    level : float
        Family-wise error rate of every step.
    criterion, minimum_improvement, effects, seed
        As in `diagnose`.
    most : int
        Most effects to add.
    ladder : Ladder, optional
        Go on from this one.
    progress : callable, optional
    on_step : callable, optional
        Called with the ladder after every step.

    Returns
    -------
    Ladder

    Raises
    ------
    InputError
        As `diagnose`.
    """
    check_numbers(level, minimum_improvement)
    kind = first_kind(criterion)
    start = model if ladder is None else ladder.model
    together = common_scale(RememberingEngine(start), prepare(start, records))
    if together is not None:
        start = together.fixed(start)
    tell = progress or (lambda share, text: None)
    climb = _Climb(records, validation, level, effects, seed, most, tell, on_step, model.values)
    by_force = ForceClimb(records, validation, level, minimum_improvement, effects, most, tell, on_step)
    found = None
    # A ladder goes on by what it has been climbed by.
    wanted = (
        ladder.criterion if criterion == "auto" and ladder is not None and ladder.criterion != "auto" else criterion
    )
    if wanted in ("auto", FORCE):
        found, decided = _by_force(by_force, start, ladder, wanted)
        if not decided:
            climbed = found is not None and found is not ladder
            found = climb(start if found is None else found.model, found or ladder, PREDICTION, climbed=climbed)
    if found is None:
        found = climb(start, ladder, kind if wanted == criterion else wanted)
    told = ([] if together is None else [together]) + effect_scales(found.model, records)
    texts = ["" if unmoved(found.findings) else turned(start, found.model), *(one.text for one in told)]
    return replace(found, findings=(*found.findings, *(text for text in texts if text)))


def _by_force(climb: ForceClimb, start: Model, ladder: Ladder | None, criterion: str) -> tuple[Ladder | None, bool]:
    """Climb by the force balance where it serves, and tell whether it has the last word.

    Where sensor noise is what is left in the end, and where it shows nothing, finer views go on.
    """
    asked = criterion == FORCE
    setting, fit = climb.begin(start, insist=asked)
    if fit is None or not (asked or (fit.model_error_rules and not against_the_command(fit))):
        if asked:
            raise needs_balance()
        return None, False
    found, last = climb(setting, fit, ladder)
    if asked:
        return found, True
    if last.relative >= NOTHING or len(found.steps) == (1 if ladder is None else len(ladder.steps)):
        return ladder, False
    return found, last.model_error_rules


@dataclass(frozen=True)
class _Climb:
    """All that does not change while a ladder grows."""

    records: Sequence[Record]
    validation: Sequence[Record]
    level: float
    effects: Sequence[str] | None
    seed: int
    most: int
    tell: Progress
    on_step: Callable[[Ladder], None] | None
    given: Mapping[str, float]

    def __call__(self, start: Model, ladder: Ladder | None, kind: str, *, climbed: bool = False) -> Ladder:
        """Climb by one criterion; on from what the force balance has found, that stays and its error with it."""
        given, spoilt = ladder, False
        found_by_force = frozenset(() if given is None or not climbed else given.added)
        setting = with_common_whitening(prepare_setting(start, self.records, kind, self.validation))
        parent = refit(setting, start)
        if ladder is None:
            fitted = with_stderr(parent, setting.records)
            ladder = Ladder((self._step(None, fitted),), criterion=kind, level=self.level)
        ladder = replace(ladder, criterion=kind, level=self.level)
        held_out = None
        if self.validation:
            held_out = replace(prepare_setting(start, self.validation, kind, self.records), whiteners=setting.whiteners)
        while True:
            count = len(ladder.added)

            def report(part: float, text: str, count: int = count) -> None:
                self.tell(count / (count + 2.0) + part / (count + 3.0), text)

            diagnosis = diagnose_fitted(
                setting, parent, level=self.level, effects=self.effects, seed=self.seed, progress=report, rungs=True,
                held_out=held_out,
            )  # fmt: skip
            if count >= self.most:
                break
            further = leap(
                setting, diagnosis.fit or parent, self.given, level=self.level, effects=self.effects, held_out=held_out,
                pairs=diagnosis.best is None and count + 1 < self.most, seed=self.seed,
            )  # fmt: skip
            if further is not None:
                diagnosis = diagnosis.or_rather(further)
            fit = diagnosis.best_fit
            if fit is None or count + len(diagnosis.rungs) > self.most:
                break
            *before, last = diagnosis.rungs
            spoilt = climbed and self._spoils(ladder, last.added.model)
            if spoilt:
                break
            for rung in before:
                ladder = self._with(ladder, rung)
                if self.on_step is not None:
                    self.on_step(ladder)
            parent = fit
            if kind == "prediction":
                # Where model error is what is left, a step that helped stays for the reader to see.
                ladder, parent = self._without_needless(ladder, fit, setting, found_by_force)
                # The order of the whitening that suited the model before need not suit it now.
                parent = refit(setting, parent.model, None, parent, reconsider=True)
                if has_contacts(parent.model):
                    parent = searched_anew(setting, parent)
                last = _with_values(last, with_stderr(parent, setting.records))
            ladder = self._with(ladder, last)
            if self.on_step is not None:
                self.on_step(ladder)
        if spoilt and given is not None:
            # What the balance says of the machine stands.
            return given if len(ladder.steps) == len(given.steps) else replace(ladder, verdict=given.verdict)
        for candidate in quantised(ladder.model, setting, self.effects):
            if len(ladder.added) < self.most:
                ladder = _with_resolution(ladder, candidate)
        diagnosis = diagnosis.why_unmoved(setting, start)
        self.tell(1.0, "done")
        return replace(
            ladder,
            verdict=diagnosis.verdict,
            candidates=diagnosis.candidates,
            untestable=diagnosis.untestable,
            findings=diagnosis.gate.findings,
            unknown=diagnosis.unknown,
            passed_over=diagnosis.passed_over,
            limits=diagnosis.gate.limits,
        )

    def _with(self, ladder: Ladder, rung: Rung) -> Ladder:
        """The ladder with one more rung; what its effect takes the place of is no rung of its own any more."""
        added = rung.added
        if added.model is None:
            return ladder
        steps = [s for s in ladder.steps if s.added is None or s.added.name != added.replaces or s.chosen_by == "user"]
        step = replace(self._step(added, added.model), set=rung.set, p_value=added.p_value)
        return replace(ladder, steps=(*steps, step), verdict=MISSING)

    def _step(self, added: Candidate | None, model: Model) -> Step:
        return Step(
            added, model, train=model_errors(model, self.records), validation=model_errors(model, self.validation)
        )

    def _spoils(self, ladder: Ladder, model: Model | None) -> bool:
        """Whether a model leaves more of the drive's force unexplained than the last one of a ladder."""
        records = self.validation or self.records
        before, after = (model_errors(one, records)["force"] for one in (ladder.model, model or ladder.model))
        return before is not None and after is not None and after > _SPOILT * before

    def _without_needless(
        self, ladder: Ladder, parent: Refit, setting: Setting, stays: Collection[str]
    ) -> tuple[Ladder, Refit]:
        """Take effects out again that a later one has made superfluous."""
        for step in ladder.steps[1:]:
            if step.added is None or step.added.name not in parent.model.effect_names:
                continue
            if step.chosen_by == "user" or step.added.name in stays:
                continue
            smaller = parent.model.without_effect(step.added.name)
            tries = in_parallel(partial(refit_or_none, setting, smaller, None), (parent, None))
            without = max((fit for fit in tries if fit is not None), key=lambda fit: fit.log_likelihood, default=None)
            if without is None or parent.log_likelihood - without.log_likelihood >= _NEEDLESS:
                continue
            ladder, parent = replace(ladder, steps=tuple(s for s in ladder.steps if s is not step)), without
        return ladder, parent


def _with_values(rung: Rung, fitted: Model) -> Rung:
    """A rung with other values for its model."""
    return replace(rung, added=replace(rung.added, model=fitted, parameters=effect_parameters(fitted, rung.added.name)))


def _with_resolution(ladder: Ladder, candidate: Candidate) -> Ladder:
    """A sensor's resolution explains scatter; it moves no parameter and no free run."""
    model = ladder.model.with_entry(
        candidate.effect, candidate.at, {name: entry["value"] for name, entry in candidate.parameters.items()}
    )
    last = ladder.steps[-1]
    step = Step(
        added=replace(candidate, model=model),
        model=model,
        set=(candidate.name,),
        p_value=candidate.p_value,
        train=last.train,
        validation=last.validation,
    )
    return replace(ladder, steps=(*ladder.steps, step))


@np.errstate(over="ignore", invalid="ignore", divide="ignore")
def add_effect(
    ladder: Ladder,
    text: str,
    records: Sequence[Record],
    validation: Sequence[Record] = (),
    *,
    criterion: str | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> Ladder:
    """Add the user's own choice instead of the proposed effect.

    Parameters
    ----------
    ladder : Ladder
    text : str
        ``effect@site`` or ``effect@site(parameter=value, ...)``.
    records, validation : sequence of Record
    criterion : str, optional
        That of the ladder when left out.
    seed : int
    progress : callable, optional

    Returns
    -------
    Ladder

    Raises
    ------
    InputError
        No such effect or site, or the model has it.
    """
    name, at, values = parse_effect(text)
    model = ladder.model
    tell = progress or (lambda share, text: None)
    tell(0.0, f"refitting with {name}@{at}")
    if (criterion or ladder.criterion) == FORCE:
        return _added_by_force(ladder, name, at, values, records, validation)
    kind = first_kind(criterion or ladder.criterion)
    setting = with_common_whitening(prepare_setting(model, records, kind))
    parent = refit(setting, model)
    trial = model.with_effect(name, at, **values)
    fit: Refit | None = None
    if not values:
        choice = [p for p in proposals(parent.model) if p.name == f"{name}@{at}"]
        if choice:
            diagnosis = diagnose_fitted(setting, parent, level=ladder.level, effects=[f"{name}@{at}"], seed=seed)
            found = diagnosis.candidates[0]
            if found.model is not None:
                return _chosen(ladder, found, found.model, records, validation)
    fit = refit(setting, trial, None, parent)
    fitted = with_stderr(fit, setting.records)
    effect = next(a.effect for a in fitted.effects if a.name == f"{name}@{at}")
    candidate = Candidate(
        effect=name,
        at=at,
        testable="yes",
        why="chosen by the user",
        text=effect.text,
        gain=fit.log_likelihood - parent.log_likelihood,
        parameters=effect_parameters(fitted, f"{name}@{at}"),
        model=fitted,
    )
    return _chosen(ladder, candidate, fitted, records, validation)


def _added_by_force(
    ladder: Ladder,
    name: str,
    at: str,
    values: Mapping[str, float],
    records: Sequence[Record],
    validation: Sequence[Record],
) -> Ladder:
    """Add the user's own choice, fitted by the force balance from what the unexplained force promises."""
    climb = ForceClimb(records, validation, ladder.level, 0.0, None, 1, lambda share, text: None, None)
    setting, parent = climb.begin(ladder.model, insist=True)
    if parent is None:
        raise needs_balance()
    fit = None if values else ForceSearch(setting, ladder.level, 0.0).best_with(parent, name, at)
    trial = ladder.model.with_effect(name, at, **values) if fit is None else fit.form.engine.model.with_theta(fit.theta)
    fit = fitted_by_force(trial, setting, insist=True)
    if fit is None:
        raise needs_balance()
    fitted, active = fitted_model(fit), trial.effects[-1]
    candidate = Candidate(
        effect=name,
        at=at,
        testable="yes",
        why="chosen by the user",
        text=active.effect.text,
        gain=fit.log_likelihood - parent.log_likelihood,
        parameters=effect_parameters(fitted, active.name),
        model=fitted,
        number=active.number,
    )
    return _chosen(ladder, candidate, fitted, records, validation)


def _chosen(
    ladder: Ladder, candidate: Candidate, model: Model, records: Sequence[Record], validation: Sequence[Record]
) -> Ladder:
    step = Step(
        added=candidate,
        model=model,
        set=(candidate.name,),
        p_value=candidate.p_value,
        chosen_by="user",
        train=model_errors(model, records),
        validation=model_errors(model, validation),
    )
    return replace(ladder, steps=(*ladder.steps, step), verdict=MISSING)
