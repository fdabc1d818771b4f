"""How a ladder ends, in words: the conclusion first."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from idloop.diagnosis import Candidate, Ladder, Step, UnknownStructure
from idloop.diagnosis.screening.proposals import proposals
from idloop.physics import load_model
from idloop.reporting.page.page import headline, verdict_text
from idloop.reporting.residual_findings import ResidualFinding, residual_warnings
from idloop.reporting.text.blocks import as_text
from idloop.reporting.text.diagnosis import ladder_blocks
from idloop.reporting.verdicts import (
    UNEXPLAINED,
    UNEXPLAINED_BY_THESE,
    VERDICTS,
    basis,
    conclusion,
    criterion_words,
    effects_looked_for,
    explained_of,
    reserved_ending,
    scope_text,
)

START = load_model("axis")
COGGING, FRICTION = "cogging@axis(amplitude=0.1)", "coulomb_friction@axis(level=0.1)"


def step(*effects: str, error: float, ties: tuple[str, ...] = ()) -> Step:
    model = START.with_effects(effects)
    added = None
    if effects:
        name, _, at = model.effect_names[-1].partition("@")
        added = Candidate(name, at, "yes", "", "Some physics.", model=model)
    measured = {"nrmse": {"axis.position": error}, "force": 0.1}
    return Step(added, model, set=() if added is None else (added.name, *ties), train=measured, validation=measured)


def ladder(*steps: Step, verdict: str = "adequate") -> Ladder:
    return Ladder(steps, verdict=verdict, criterion="prediction")


SPOILT = (step(error=0.1), step(COGGING, error=0.5))


@pytest.mark.parametrize("verdict", ["adequate", "not_excited"])
def test_what_spoils_the_free_run_is_not_what_is_missing(verdict: str) -> None:
    found = ladder(*SPOILT, verdict=verdict)
    said = conclusion(found)
    assert said.startswith(f"{UNEXPLAINED} is missing: cogging@axis takes its place")
    assert VERDICTS[verdict] in said
    assert headline(found) == f"Missing from the model: {UNEXPLAINED}."
    assert verdict_text(found).lower().startswith(UNEXPLAINED)


def test_what_a_later_step_makes_good_is_not_held_against_the_model() -> None:
    good = ladder(*SPOILT, step(COGGING, FRICTION, error=0.05))
    assert [one.name for one in good.worsened] == ["cogging@axis"]
    assert good.still_worsened == []
    assert conclusion(good) == VERDICTS["adequate"]
    assert headline(good) == "Missing from the model: cogging and Coulomb friction."
    bad = ladder(*SPOILT, step(COGGING, FRICTION, error=0.4))
    assert [one.name for one in bad.still_worsened] == ["cogging@axis"]
    assert headline(bad) == f"Missing from the model: Coulomb friction and {UNEXPLAINED}."


@pytest.mark.parametrize("verdict", ["adequate", "not_excited"])
@pytest.mark.parametrize(
    ("errors", "said"),
    [
        ({"force": 4.3}, "the error of the drive force is 430 % of the commanded force"),
        ({"force": 43.0}, "the error of the drive force is 43 times the commanded force"),
        ({"force": None, "anew": {"a": 1.2, "b": 1.0}}, "the free run of every output is no better than a constant"),
        ({"force": 0.1, "anew": {"a": 1.2}}, ""),
        ({"force": None, "anew": {"a": 1.2, "b": 0.5}}, ""),
        ({}, ""),
    ],
)
def test_no_verdict_of_noise_stands_alone_beside_a_large_error(verdict: str, errors: dict, said: str) -> None:
    found = ladder(replace(step(error=0.1), train=errors, validation=errors), verdict=verdict)
    if not said:
        assert conclusion(found) == VERDICTS[verdict]
        return
    assert conclusion(found) == f"{UNEXPLAINED} is left: {said}; of the catalogue {VERDICTS[verdict]}"
    assert headline(found) == f"Missing from the model: {UNEXPLAINED}."
    assert verdict_text(found).lower().startswith(UNEXPLAINED)
    assert any(said in line for line in as_text(ladder_blocks(found)).splitlines())
    assert reserved_ending(verdict, (), errors) == conclusion(found)


@pytest.mark.parametrize("verdict", ["unknown_structure", "missing"])
def test_a_verdict_that_claims_no_end_stays(verdict: str) -> None:
    assert conclusion(ladder(*SPOILT, verdict=verdict)) == VERDICTS[verdict]


def test_errors_that_follow_the_command_come_before_nothing_significant() -> None:
    found = ladder(step(error=0.1))
    follows, free = (
        ResidualFinding("a", SimpleNamespace(follows=not one, against="input"))  # type: ignore[arg-type]
        for one in (False, True)
    )
    assert conclusion(found, [free]) == VERDICTS["adequate"]
    assert conclusion(found, [free, follows]).startswith(f"{UNEXPLAINED} is left")


def weighed(found: Ladder, *only: str) -> Ladder:
    """The ladder as it ends when only these effects were looked for; all without any."""
    named = proposals(found.model, only or None)
    return replace(
        found, candidates=tuple(Candidate(one.effect.name, one.at, "yes", "", "Some physics.") for one in named)
    )


def test_what_was_not_looked_for_is_not_said_to_explain_nothing() -> None:
    found = ladder(step(error=0.1), step(FRICTION, error=0.05), verdict="unknown_structure")
    few = weighed(found, "cogging", "dead_zone")
    assert effects_looked_for(few) == ("Coulomb friction", "cogging", "dead zone")
    assert headline(few) == f"Missing from the model: Coulomb friction and {UNEXPLAINED_BY_THESE}."
    assert verdict_text(few) == (
        "What is left has a shape that none of the effects looked for explains."
        " Only Coulomb friction, cogging and dead zone were looked for, not the whole catalogue."
    )
    assert "of the catalogue" not in conclusion(few, (), scope_text(few))
    # The one effect that was looked for has come in: there is nothing left to weigh.
    one = replace(found, findings=("20 s in 2 records",))
    assert effects_looked_for(one) == ("Coulomb friction",)
    assert verdict_text(one).endswith("Only Coulomb friction was looked for, not the whole catalogue.")
    assert headline(one) == headline(few)
    everything = weighed(found)
    assert effects_looked_for(everything) == ()
    assert headline(everything) == f"Missing from the model: Coulomb friction and {UNEXPLAINED}."
    assert conclusion(everything) == VERDICTS["unknown_structure"]


@pytest.mark.parametrize("verdict", ["adequate", "not_excited", "unknown_structure"])
def test_few_effects_that_do_not_show_leave_the_others_open(verdict: str) -> None:
    start = ladder(step(error=0.1), verdict=verdict)
    few = weighed(start, "cogging")
    for said in (headline(few), conclusion(few, (), scope_text(few)), verdict_text(few)):
        assert "looked for" in said
        assert "of the catalogue" not in said
    assert verdict_text(few).endswith("Only cogging was looked for, not the whole catalogue.")
    everything = weighed(start)
    assert scope_text(everything) == scope_text(replace(few, candidates=())) == ""
    assert "looked for" not in headline(everything) + verdict_text(everything)


def test_of_what_a_share_is_one_depends_on_the_criterion() -> None:
    assert "one-step prediction errors" in explained_of("prediction")
    assert "free-run errors" in explained_of("simulation")
    assert "drive force" in explained_of("force")
    # A chain of bodies is judged by the forces on all of them: that on the drive alone may be noise.
    assert (
        explained_of("force", 4) == "the power of the force on every body that the model without it leaves unexplained"
    )
    assert criterion_words("force", 4) == "the force on every body that the measured motion leaves unexplained"
    assert explained_of("simulation", 4) == explained_of("simulation")
    assert explained_of("") == "the power of the errors that the model without it leaves"


def test_a_list_says_of_which_model_it_is_one() -> None:
    assert basis([]) == ""
    assert basis(["cogging@axis"]) == "as long as cogging@axis is not in the model, "
    assert basis(["a", "b"]) == "as long as a and b are not in the model, "


def test_a_tie_ends_when_the_rival_has_come_in() -> None:
    tied = step(FRICTION, error=0.2, ties=("cogging@axis", "load_torque@axis"))
    alone = ladder(step(error=0.3), tied)
    assert alone.rivals(tied) == ("cogging@axis", "load_torque@axis")
    both = ladder(step(error=0.3), tied, step(FRICTION, COGGING, error=0.1))
    assert both.rivals(tied) == ("load_torque@axis",)
    # What the step found then stays in the document, and an undo brings it back.
    assert both.to_dict()["ladder"][1]["set"] == list(tied.set)
    assert both.undo().rivals(tied) == alone.rivals(tied)


def test_what_an_effect_contains_is_said_to_be_where_it_was() -> None:
    stribeck = "stribeck_friction@axis(coulomb=0.1,static=0.2,velocity=0.1)"
    rich = step(stribeck, error=0.1)
    assert rich.added is not None
    rich = replace(rich, added=replace(rich.added, replaces="coulomb_friction@axis"))
    grown = ladder(step(error=0.3), rich)
    assert grown.replaced(grown.steps[0]) == ""
    assert grown.replaced(rich) == (
        "it contains coulomb_friction@axis, which was added before it and is no step of its own any more"
    )
    assert grown.replaced(rich) in as_text(ladder_blocks(grown))
    given = ladder(replace(step(FRICTION, error=0.3), added=None), rich)
    assert given.replaced(rich) == "in place of coulomb_friction@axis of the start model, which it contains"
    chosen = ladder(step(error=0.3), replace(step(FRICTION, error=0.2), chosen_by="user"), rich)
    assert chosen.replaced(rich) == "in place of coulomb_friction@axis, which it contains"


def test_a_coefficient_that_is_not_constant_is_what_is_missing() -> None:
    at = np.linspace(0.0, 2.0 * np.pi, 13)
    curve = UnknownStructure(
        "axis.position within a turn", "rad", "kg·m²", at, 0.01 * np.cos(at), np.full(13, 1e-3), 0.3, "", of="inertia"
    )
    found = replace(ladder(step(error=0.1), step(FRICTION, error=0.05), verdict="unknown_structure"), unknown=curve)
    assert headline(found) == "Missing from the model: Coulomb friction and inertia that is not constant."
    assert verdict_text(found) == "Inertia changes over axis.position within a turn: by 0.02 kg·m² in all."
    assert UnknownStructure.from_dict(curve.to_dict()).what == "change of the inertia"


@pytest.mark.parametrize("verdict", ["adequate", "not_excited"])
def test_a_headline_of_nothing_missing_carries_what_the_residual_tests_say_against_it(verdict: str) -> None:
    start = ladder(step(error=0.1), verdict=verdict)
    coloured, follows = (
        ResidualFinding(
            "a",
            SimpleNamespace(
                name="axis.position", coloured=not free, follows=free, against="input", ljung_box_p=1e-9, cross_p=0.004
            ),  # type: ignore[arg-type]
        )
        for free in (False, True)
    )
    for left in ([coloured], [follows]):
        (warning,) = residual_warnings(verdict, left)
        assert headline(start, left).endswith(f", {warning}.")
        assert "noise" not in verdict_text(start, left)
    assert "but the" not in headline(start)
    # Where something was added, the headline names that.
    assert headline(ladder(step(error=0.3), step(FRICTION, error=0.1)), [coloured]) == (
        "Missing from the model: Coulomb friction."
    )


def test_a_ladder_that_adds_nothing_of_what_it_found_says_so():
    """Seven effects tied, none was added, and the report began with "No effect was added. Stopped before the end"."""
    rivals = tuple(
        Candidate(name, at, "yes", "", "", gain=170.0, p_value=1e-9)
        for name, at in (("coulomb_friction", "motor"), ("dead_zone", "input"))
    )
    ladder = Ladder((Step(None, load_model("dc_motor")),), verdict="missing", criterion="force", candidates=rivals)
    assert headline(ladder) == "An effect is missing, and none was added."
    assert verdict_text(ladder).startswith("Significant and not added: Coulomb friction @ motor and dead zone @ input.")
