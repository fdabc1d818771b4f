"""The ladder, and one step of it, by the force balance along the measured motion."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from idloop.diagnose.candidate import Candidate, Rung, effect_parameters
from idloop.diagnose.diagnosis import Diagnosis
from idloop.diagnose.errors import model_errors
from idloop.diagnose.force_search import ForceSearch, Step, Weighed
from idloop.diagnose.gate import Gate, excitation_findings
from idloop.diagnose.ladder import Ladder
from idloop.diagnose.ladder import Step as Rise
from idloop.diagnose.setting import Setting, prepare_setting
from idloop.diagnose.unknown import UnknownStructure
from idloop.diagnose.verdict import ADEQUATE, MISSING, UNKNOWN
from idloop.errors import InputError
from idloop.estimate.dataset import prepare
from idloop.estimate.engine import RememberingEngine
from idloop.estimate.weak_fit import WeakFit, draft_of, fit_anew, fit_by_force
from idloop.estimate.weak_form import WeakForm
from idloop.physics.model import Model
from idloop.records import Record

Progress = Callable[[float, str], None]


# Where the best model leaves this part of the drive's force, it is not the force that moves the axis.
NOTHING = 0.9
# With the command turned a model explains far more where it leaves less than this part of what it leaves otherwise.
_FAR_LESS = 0.5
# A model that leaves less than this part of it is adequate where no effect explains more.
_ADEQUATE = 0.1


def fitted_by_force(
    model: Model, setting: Setting, known: dict[int, WeakForm] | None = None, *, insist: bool = False
) -> WeakFit | None:
    """The model fitted by its force balance; None where that cannot serve."""
    return fit_by_force(RememberingEngine(model), setting.data, model.theta, known, insist=insist)


def against_the_command(fit: WeakFit) -> bool:
    """Whether the same model explains far more of the force with the sign of the command turned."""
    return fit_anew(draft_of(fit.form).turned(), fit.point).relative < _FAR_LESS * fit.relative


def fitted_model(fit: WeakFit) -> Model:
    """The model with its fitted values and their standard errors."""
    model, variance = fit.form.engine.model, np.diag(fit.covariance)
    values = dict(zip(model.free, (float(v) for v in fit.theta), strict=True))
    errors = {n: float(np.sqrt(v)) for n, v in zip(model.free, variance, strict=False) if np.isfinite(v) and v >= 0.0}
    return model.with_values(values, errors)


@dataclass(frozen=True)
class ForceClimb:
    """Climbs a ladder by the force balance.

    Attributes
    ----------
    records, validation : sequence of Record
        What is fitted, and on what an effect has to explain something, too.
    level : float
        Family-wise error rate of every step.
    least : float
        Part by which an effect must make the errors on unseen samples smaller.
    effects : sequence of str or None
    most : int
        Most effects to add.
    tell : callable
    on_step : callable or None
    forms : dict of int to WeakForm
        Windows of the records by width.
    """

    records: Sequence[Record]
    validation: Sequence[Record]
    level: float
    least: float
    effects: Sequence[str] | None
    most: int
    tell: Progress
    on_step: Callable[[Ladder], None] | None
    forms: dict[int, WeakForm] = field(default_factory=dict)

    def begin(self, model: Model, *, insist: bool) -> tuple[Setting, WeakFit | None]:
        """Records laid out, and the model fitted to them."""
        setting = prepare_setting(model, self.records, "prediction", self.validation)
        return setting, fitted_by_force(model, setting, self.forms, insist=insist)

    def __call__(self, setting: Setting, fit: WeakFit, ladder: Ladder | None = None) -> tuple[Ladder, WeakFit]:
        """Climb from a fitted model.

        Parameters
        ----------
        setting : Setting
        fit : WeakFit
        ladder : Ladder, optional
            Go on from this one.

        Returns
        -------
        ladder : Ladder
        fit : WeakFit
            Of its last model.
        """
        start = fit.form.engine.model
        held_out = prepare(start, self.validation, beside=self.records) if self.validation else []
        search = ForceSearch(setting, self.level, self.least, self.effects, held_out)
        if ladder is None:
            ladder = Ladder((self._rise(None, fitted_model(fit)),), level=self.level)
        ladder = replace(ladder, criterion="force", level=self.level)
        while True:
            count = len(ladder.added)
            self.tell(count / (count + 2.0), f"weighing effects beside {count}" if count else "weighing effects")
            step = search.weigh(fit)
            if not step.tied or count + len(step.tied[0].proposals) > self.most:
                break
            rungs, fit = self._taken(step, setting)
            for rung in rungs:
                ladder = self._with(ladder, rung)
            ladder, fit = self._without_needless(ladder, fit, search, setting)
            if self.on_step is not None:
                self.on_step(ladder)
        self.tell(1.0, "done")
        return self._concluded(ladder, step, setting, fit), fit

    def _taken(self, step: Step, setting: Setting) -> tuple[list[Rung], WeakFit]:
        """What the best choice of a step adds, one effect after the other, and the model that has it all."""
        best = step.tied[0]
        fit = self._again(best.fit, setting) or best.fit
        rungs = []
        if len(best.proposals) > 1:
            first = best.proposals[0]
            alone = next((one for one in step.weighed if one.names == (first.name,)), best)
            rungs.append(Rung(_candidate(step, alone, 0, fitted_model(alone.fit)), (first.name,)))
        names = _names(step) if len(best.proposals) == 1 else best.names[-1:]
        rungs.append(Rung(_candidate(step, best, -1, fitted_model(fit)), names))
        return rungs, fit

    def _again(self, fit: WeakFit, setting: Setting) -> WeakFit | None:
        """The same model in windows as wide as its noise asks for."""
        return fit_by_force(fit.form.engine, setting.data, fit.theta, self.forms, insist=True)

    def _with(self, ladder: Ladder, rung: Rung) -> Ladder:
        added = rung.added
        steps = [s for s in ladder.steps if s.added is None or s.added.name != added.replaces or s.chosen_by == "user"]
        model = added.model
        if model is None:
            return ladder
        step = replace(self._rise(added, model), set=rung.set, p_value=added.p_value)
        return replace(ladder, steps=(*steps, step), verdict=MISSING)

    def _rise(self, added: Candidate | None, model: Model) -> Rise:
        return Rise(
            added, model, train=model_errors(model, self.records), validation=model_errors(model, self.validation)
        )

    def _without_needless(
        self, ladder: Ladder, fit: WeakFit, search: ForceSearch, setting: Setting
    ) -> tuple[Ladder, WeakFit]:
        """Take effects out again that a later one has made superfluous."""
        for step in ladder.steps[1:-1]:
            name = None if step.added is None else step.added.name
            if name is None or step.chosen_by == "user" or name not in fit.form.engine.model.effect_names:
                continue
            without = search.needless(fit, name)
            if without is None:
                continue
            fit = self._again(without, setting) or without
            last = ladder.steps[-1]
            kept = tuple(s for s in ladder.steps[:-1] if s is not step)
            renewed = replace(self._rise(last.added, fitted_model(fit)), set=last.set, p_value=last.p_value)
            ladder = replace(ladder, steps=(*kept, renewed))
        return ladder, fit

    def _concluded(self, ladder: Ladder, step: Step, setting: Setting, fit: WeakFit) -> Ladder:
        gate = _gate(step, setting)
        verdict, findings = _verdict(step, fit)
        return replace(
            ladder,
            verdict=verdict,
            candidates=_candidates(step),
            untestable=gate.untestable,
            findings=(*gate.findings, *findings),
            unknown=_unknown(step),
            passed_over=_passed_over(step),
            limits={},
        )


def diagnosed_by_force(step: Step, setting: Setting) -> Diagnosis:
    """What one step has found, as a diagnosis.

    Parameters
    ----------
    step : Step
    setting : Setting

    Returns
    -------
    Diagnosis
    """
    gate, fit = _gate(step, setting), step.whole
    verdict, findings = (MISSING, ()) if step.tied else _verdict(step, fit)
    best = step.tied[0] if step.tied else None
    pair = alone = None
    if best is not None and len(best.proposals) > 1:
        pair = (best.proposals[0].name, best.proposals[1].name)
        first = next((one for one in step.weighed if one.names == pair[:1]), best)
        alone = _candidate(step, first, 0, fitted_model(first.fit))
    return Diagnosis(
        model=fitted_model(fit),
        candidates=_candidates(step),
        set=_names(step),
        verdict=verdict,
        gate=replace(gate, findings=(*gate.findings, *findings)),
        unknown=None if step.tied else _unknown(step),
        criterion="force",
        level=step.level,
        fit=None,
        pair=pair,
        rival_pairs=tuple((a, b) for one in step.tied[1:] if len(one.names) == 2 for a, b in [one.names]),
        alone=alone,
        passed_over=_passed_over(step),
    )


def _names(step: Step) -> tuple[str, ...]:
    """The first effect of the best choice, and single effects that the data cannot tell from it."""
    if not step.tied:
        return ()
    best = step.tied[0]
    if len(best.names) > 1:
        return best.names[:1]
    return (best.names[0], *(one.names[0] for one in step.tied[1:] if len(one.names) == 1))


def _candidate(step: Step, one: Weighed, which: int, model: Model) -> Candidate:
    proposal = one.proposals[which]
    samples = max(one.evidence.samples, 1)
    together = [other.name for other in one.proposals if other is not proposal]
    return Candidate(
        effect=proposal.effect.name,
        at=proposal.at,
        testable="yes",
        why=f"it shows together with {together[0]} only" if together else "",
        text=proposal.effect.text,
        gain=one.evidence.difference,
        p_value=max(one.evidence.p_value(math.comb(step.count, len(one.proposals))), 1e-300),
        explains=float(np.clip(1.0 - np.exp(-2.0 * one.evidence.difference / samples), 0.0, 1.0)),
        parameters=effect_parameters(model, proposal.name),
        model=model,
        replaces=proposal.replaces,
        number=proposal.number,
    )


def _candidates(step: Step) -> tuple[Candidate, ...]:
    """All effects that were looked for, the best choice first, each once; those that were screened only come last."""
    found: dict[str, Candidate] = {}
    others = sorted((one for one in step.weighed if one not in step.tied), key=lambda one: -one.merit)
    for one in [*step.tied, *others]:
        model = one.fit.form.engine.model.with_theta(one.fit.theta)
        if step.named is not None and one is step.tied[0]:
            model = fitted_model(step.named)
        for which, proposal in enumerate(one.proposals):
            found.setdefault(proposal.name, _candidate(step, one, which, model))
    for proposal in step.asked:
        name, effect = proposal.name, proposal.effect
        testable, why = step.testable.get(name, "no"), step.why.get(name, "")
        found.setdefault(
            name,
            Candidate(
                effect.name,
                proposal.at,
                testable,
                why,
                effect.text,
                replaces=proposal.replaces,
                number=proposal.number,
            ),
        )
    return tuple(found.values())


def _gate(step: Step, setting: Setting) -> Gate:
    model = step.parent.form.engine.model.with_theta(step.parent.theta)
    return Gate(excitation_findings(model, setting), dict(step.testable), dict(step.why))


def _unknown(step: Step) -> UnknownStructure | None:
    """The curve that remains, where one does."""
    if step.structure is None:
        return None
    return step.structure.unknown(max(step.structure.evidence.p_value(step.count), 1e-300))


def _verdict(step: Step, fit: WeakFit) -> tuple[str, tuple[str, ...]]:
    """What is left, judged by the drive's force."""
    if step.structure is not None:
        return UNKNOWN, ()
    if fit.relative < _ADEQUATE or not fit.model_error_rules:
        return ADEQUATE, ()
    text = (
        f"{100.0 * fit.relative:.3g} % of the drive force stays unexplained, which sensor noise does not account for: "
        "no effect that was looked for explains more of it on samples that the fit has not seen"
    )
    return UNKNOWN, (text,)


def _passed_over(step: Step) -> dict[str, str]:
    """Effects that show and are not worth a name, and why."""
    found = {
        one.names[-1]: f"it stands in for something that explains far more: {step.structures[0].curve.text}"
        for one in step.stand_ins
    }
    for one in step.significant:
        if one in step.tied or one in step.stand_ins or len(one.proposals) > 1:
            continue
        if step.worth(one):
            if one.hollow:
                found.setdefault(one.names[-1], "nothing is left in it of the plainer effect that it contains")
            continue
        part = step.smaller(one)
        found.setdefault(
            one.names[-1],
            "it explains nothing of the held-out records"
            if one.held_out == part and part <= 0.0
            else f"it makes the unexplained force smaller by {100.0 * max(part, 0.0):.2g} % only, and "
            f"{100.0 * step.least:g} % is asked for",
        )
    return {name: why for name, why in found.items() if name not in _names(step)}


def needs_balance() -> InputError:
    """What to say where a force balance was asked for and cannot serve."""
    return InputError(
        "the force criterion needs every body's position or velocity at a steady rate, and some hundred samples; "
        "use prediction"
    )
