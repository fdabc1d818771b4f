"""A ladder ends, whatever a view names, and superfluous effects are removed by the fit without them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from idloop.diagnosis.evidence.predictive import Evidence, Scores
from idloop.diagnosis.screening.proposals import proposals
from idloop.diagnosis.search.climb import Climb
from idloop.diagnosis.search.step import EvaluatedModel, SearchStep, View
from idloop.physics import Model, load_model

FRICTION, DRAG = "coulomb_friction@axis", "quadratic_drag@axis"


@dataclass(frozen=True)
class Fit:
    model: Model
    log_likelihood: float = 0.0

    @property
    def covariance(self) -> Any:
        return np.zeros((len(self.model.free), len(self.model.free)))


class Answers(SearchStep[Any]):
    """All that was evaluated shows and is worth a name; a free run asks for no standard errors."""

    criterion = "simulation"

    def improvement(self, one: EvaluatedModel[Any]) -> float:
        return one.evidence.improvement

    def jointly_needed(self, pair: EvaluatedModel[Any]) -> bool:
        return True

    def insignificance(self, one: EvaluatedModel[Any]) -> str:
        return "it is too small"

    def reported(self, fit: Any) -> Model:
        model: Model = fit.model
        return model

    def verdict(self) -> tuple[str, tuple[str, ...]]:
        return "adequate", ()


def evaluated(model: Model, name: str, difference: float, samples: int = 1000) -> EvaluatedModel[Any]:
    (proposal,) = proposals(model, [name])
    fit: Any = Fit(proposal.model({}))
    scores = Scores(np.full(samples, difference / samples), [np.arange(samples)])
    return EvaluatedModel((proposal,), fit, scores, Evidence(difference, 1.0, 0.1 * difference, samples), difference)


class Fickle(View[Any]):
    """Wants dry friction beside drag and drag beside dry friction, and neither beside the other."""

    def __init__(self, dropping: bool) -> None:
        self.dropping, self.steps = dropping, 0

    def within(self, begin: float, end: float) -> View[Any]:
        return self

    def evaluate(self, parent: Any) -> SearchStep[Any]:
        self.steps += 1
        wanted = [name for name in (FRICTION, DRAG) if name not in parent.model.effect_names]
        return Answers(parent, tuple(evaluated(parent.model, name, 100.0) for name in wanted[:1]), 2, 0.01, 0.01)

    def reported(self, fit: Any) -> Model:
        model: Model = fit.model
        return model

    def refit_thoroughly(self, fit: Any) -> Any:
        return fit

    def refitted(self, model: Model, fit: Any) -> Model:
        return model

    def without(self, fit: Any, name: str) -> Any:
        return Fit(fit.model.without_effect(name)) if self.dropping else None


def climb(view: Fickle) -> Climb[Any]:
    return Climb(view, (), (), "prediction", 0.01, 8, lambda share, text: None)


def test_a_ladder_does_not_turn_in_a_circle() -> None:
    view = Fickle(dropping=True)
    ladder, fit = climb(view)(Fit(load_model("axis")))
    # Each has been taken out once and has come back; then both stay.
    assert set(ladder.added) == set(fit.model.effect_names) == {FRICTION, DRAG}
    assert view.steps < 8


class Waves(View[Any]):
    """Finds three waves, of which the first has become superfluous in the end."""

    def within(self, begin: float, end: float) -> View[Any]:
        return self

    def evaluate(self, parent: Any) -> SearchStep[Any]:
        more = len(parent.model.effects) < 3 and "cogging#3@axis" not in parent.model.effect_names
        return Answers(parent, (evaluated(parent.model, "cogging@axis", 100.0),) if more else (), 1, 0.01, 0.01)

    def reported(self, fit: Any) -> Model:
        model: Model = fit.model
        return model

    def refit_thoroughly(self, fit: Any) -> Any:
        return fit

    def refitted(self, model: Model, fit: Any) -> Model:
        return model

    def without(self, fit: Any, name: str) -> Any:
        full = len(fit.model.effects) == 3
        return Fit(fit.model.without_effect(name)) if full and name == "cogging@axis" else None


def test_a_wave_that_has_become_superfluous_goes_and_the_others_keep_their_names() -> None:
    view = Waves()
    ladder, fit = Climb(view, (), (), "prediction", 0.01, 8, lambda share, text: None)(Fit(load_model("axis")))
    assert ladder.added == ("cogging#2@axis", "cogging#3@axis")
    assert fit.model.effect_names == ladder.model.effect_names == ladder.added


class Severe(Fickle):
    """Wants nothing, and drops everything."""

    def evaluate(self, parent: Any) -> SearchStep[Any]:
        self.steps += 1
        return Answers(parent, (), 2, 0.01, 0.01)


def test_all_effects_that_a_second_view_finds_superfluous_are_no_steps_any_more() -> None:
    start, fit = climb(Fickle(dropping=False))(Fit(load_model("axis")))
    assert start.added == (FRICTION, DRAG)
    view = Severe(dropping=True)
    ladder, fit = Climb(view, (), (), "prediction", 0.01, 8, lambda share, text: None, reduces=True)(fit, start)
    assert ladder.added == fit.model.effect_names == ()
    # Beside what stays, once.
    assert view.steps == 1


LOAD, OFFSET, GEAR = "load_torque@axis", "input_offset@input", "load_dependent_friction@axis"


class Tied(Fickle):
    """An offset and a load do the same; friction in the gear shows beside the load only, if at all."""

    def __init__(self, gear: bool) -> None:
        super().__init__(dropping=False)
        self.gear = gear

    def evaluate(self, parent: Any) -> SearchStep[Any]:
        self.steps += 1
        names = parent.model.effect_names
        wanted = [OFFSET, LOAD] if not names else [GEAR] if names == (LOAD,) and self.gear else []
        return Answers(parent, tuple(evaluated(parent.model, name, 100.0) for name in wanted), 2, 0.01, 0.01)

    def leaves_model_error(self, fit: Any) -> bool:
        return True

    def exchanged(self, fit: Any, name: str, other: str) -> Any:
        (proposal,) = proposals(fit.model.without_effect(name), [other])
        return Fit(proposal.model({}))


@pytest.mark.parametrize("gear", [False, True])
def test_of_a_tie_that_effect_stays_beside_which_more_is_found(gear: bool) -> None:
    view = Tied(gear)
    ladder, fit = climb(view)(Fit(load_model("axis")))
    assert ladder.added == fit.model.effect_names == ((LOAD, GEAR) if gear else (OFFSET,))
    assert ladder.steps[1].set == (OFFSET, LOAD)
    assert [step.model.effect_names for step in ladder.steps[:2]] == [(), (LOAD,) if gear else (OFFSET,)]
    # Each is tried once.
    assert view.steps == (5 if gear else 3)


def test_a_ladder_adds_what_shows_and_ends_with_the_verdict_of_the_last_step() -> None:
    ladder, fit = climb(Fickle(dropping=False))(Fit(load_model("axis")))
    assert ladder.added == (FRICTION, DRAG)
    assert ladder.verdict == "adequate"
    assert [step.model.effect_names for step in ladder.steps] == [(), (FRICTION,), (FRICTION, DRAG)]
    assert fit.model is ladder.model


def test_a_model_that_is_worse_in_the_other_view_ends_the_ladder_with_what_was_there() -> None:
    start, _ = climb(Fickle(dropping=False))(Fit(load_model("axis")))
    before = start.undo()
    guarded = Climb(
        Fickle(dropping=False), (), (), "prediction", 0.01, 8, lambda share, text: None, worse=lambda one, other: True
    )
    ladder, _ = guarded(Fit(before.model), before)
    assert ladder.steps == before.steps
    assert ladder.verdict == "adequate"
    assert ladder.passed_over == {DRAG: "with it the model explains less of the records"}


class Late(Fickle):
    """Explains more with an earlier command."""

    asked = 0

    def with_timing(self, step: SearchStep[Any]) -> tuple[View[Any], Any]:
        self.asked += 1
        return Fickle(dropping=False), Fit(step.parent.model.with_values({"axis.viscous_friction": 9.0}))


@pytest.mark.parametrize("worse", [False, True])
def test_an_earlier_command_whose_values_explain_less_of_the_force_is_refused_once(worse: bool) -> None:
    view = Late(dropping=False)
    guarded = Climb(
        view, (), (), "prediction", 0.01, 8, lambda share, text: None,
        worse=lambda one, other: worse and other.values["axis.viscous_friction"] == 9.0,
    )  # fmt: skip
    ladder, _ = guarded(Fit(load_model("axis")))
    assert (ladder.model.values["axis.viscous_friction"] == 9.0) is not worse
    assert set(ladder.added) == {FRICTION, DRAG}
    assert view.asked == 1


class Predicted(Answers):
    """Answers with the standard errors of predictions."""

    criterion = "prediction"

    def reported(self, fit: Any) -> Model:
        known = fit.model.with_values({f"{FRICTION}.level": 0.3} if FRICTION in fit.model.effect_names else {})
        model: Model = known.with_values({}, dict.fromkeys(known.free, 0.1))
        return model


class Vague(Fickle):
    """Wants dry friction and drag at once, of which the data determine the friction only."""

    def evaluate(self, parent: Any) -> SearchStep[Any]:
        wanted = [name for name in (DRAG, FRICTION) if name not in parent.model.effect_names]
        found = [evaluated(parent.model, name, 200.0 if name == DRAG else 100.0) for name in wanted]
        return Predicted(parent, tuple(found), 2, 0.01, 0.01)


def test_what_all_samples_do_not_determine_is_no_step_and_the_next_best_is() -> None:
    ladder, _ = climb(Vague(dropping=False))(Fit(load_model("axis")))
    assert ladder.added == (FRICTION,)
    assert "do not determine its coefficient" in ladder.passed_over[DRAG]


def test_the_step_that_shows_too_little_is_passed_over_with_the_reason() -> None:
    model = load_model("axis")
    parent: Any = SimpleNamespace(model=model)
    step = Answers(parent, (evaluated(model, FRICTION, 20.0, 10_000),), 2, 0.01, 0.01)
    assert step.significant
    assert not step.tied
    assert step.passed_over == {FRICTION: "it is too small"}
    refused = Answers(parent, (evaluated(model, FRICTION, 200.0),), 2, 0.01, 0.01, rejected={FRICTION: "it harms"})
    assert refused.passed_over == {FRICTION: "it harms"}


def test_a_simple_effect_goes_before_one_that_contains_it() -> None:
    model = load_model("axis")
    parent: Any = SimpleNamespace(model=model)
    several = (evaluated(model, "stribeck_friction@axis", 300.0), evaluated(model, FRICTION, 200.0))
    step = Answers(parent, several, 2, 0.01, 0.01)
    assert step.names == (FRICTION,)


def test_what_no_fit_gains_is_not_significant() -> None:
    """Linearised folds may fail: unseen samples then show an effect that the fitted ones do not."""
    plain = load_model("axis")
    found = evaluated(plain, FRICTION, 40.0)
    for gain, names in ((40.0, (FRICTION,)), (3.0, ())):
        step = Answers(Fit(plain), (replace(found, gain=gain),), 40, 0.01, 0.01)
        assert step.names == names


def test_two_effects_degenerate_to_two_of_which_one_is_simpler() -> None:
    model = load_model("axis")
    friction, spring, load, wave = (
        evaluated(model, name, 100.0).proposals[0] for name in (FRICTION, "cable_spring", "load_torque", "imbalance")
    )

    def pair(*proposals: Any) -> EvaluatedModel[Any]:
        return replace(evaluated(model, FRICTION, 100.0), proposals=proposals)

    assert pair(friction, spring).degenerates_to(pair(friction, load))
    assert pair(spring).degenerates_to(pair(load))
    assert not pair(friction, load).degenerates_to(pair(friction, spring))
    assert not pair(friction, spring).degenerates_to(pair(wave, load))
    assert not pair(friction, spring).degenerates_to(pair(load))


class Replacing(Fickle):
    """Wants dry friction, drag, and then a friction that contains the dry one."""

    def evaluate(self, parent: Any) -> SearchStep[Any]:
        self.steps += 1
        if self.steps < 3:
            found = [evaluated(parent.model, (FRICTION, DRAG)[self.steps - 1], 100.0)]
        elif self.steps == 3:
            one = evaluated(parent.model, "stribeck_friction@axis", 100.0)
            level = {"stribeck_friction@axis.coulomb": 0.1, "stribeck_friction@axis.static": 0.2}
            found = [replace(one, fit=Fit(one.fit.model.with_values(level)))]
        else:
            found = []
        return Answers(parent, tuple(found), 2, 0.01, 0.01)


def test_an_effect_that_replaces_another_takes_its_place() -> None:
    """The rows in between then show what their own effects explain, not what the replaced one did."""
    ladder, _ = climb(Replacing(dropping=False))(Fit(load_model("axis")))
    assert ladder.added == ("stribeck_friction@axis", DRAG)
    assert [set(step.model.effect_names) for step in ladder.steps] == [
        set(), {"stribeck_friction@axis"}, {"stribeck_friction@axis", DRAG}
    ]  # fmt: skip
