"""Equivalent effects: which there are, in which models, and the checks that separate them by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from idloop.diagnosis import Candidate, Ladder
from idloop.diagnosis.equivalence.equivalent_effects import (
    equivalent_effects_of_ladder,
    equivalent_rivals,
    find_equivalent_effects,
    without_equivalents,
)
from idloop.diagnosis.ladder import Step
from idloop.physics import load_model, simulate
from idloop.reporting.verdicts import significant_not_added, undetectable

OFFSET, LOAD, ASYMMETRIC = "input_offset@input", "load_torque@motor", "asymmetric_friction@motor"
FRICTION, DEAD = "coulomb_friction@motor", "dead_zone@input"


def model(*effects: str):
    return load_model("dc_motor").with_effects(list(effects))


def groups(*arguments) -> list[tuple[str, ...]]:
    return [one.names for one in find_equivalent_effects(*arguments)]


def test_an_offset_is_equivalent_to_a_load_behind_a_linear_drive_only():
    assert groups(model(), [OFFSET, LOAD]) == [(OFFSET, LOAD)]
    assert groups(model("actuator_lag@input(time_constant=0.01)"), [OFFSET, LOAD]) == [(OFFSET, LOAD)]
    assert groups(model("saturation@input(limit=2)"), [OFFSET, LOAD]) == [(OFFSET, LOAD)]
    assert groups(model(f"{DEAD}(width=0.1)"), [OFFSET, LOAD]) == []
    # With one of the two in the model already, as a ladder has it.
    assert groups(model(f"{OFFSET}(offset=0.1)"), [OFFSET, LOAD]) == [(OFFSET, LOAD)]


def test_a_load_on_another_body_is_no_offset():
    torsion = load_model("torsion")
    assert groups(torsion, [OFFSET, f"load_torque@{torsion.bodies[0]}", f"load_torque@{torsion.bodies[-1]}"]) == [
        (OFFSET, f"load_torque@{torsion.bodies[0]}")
    ]


def test_friction_that_differs_by_direction_is_a_load_beside_friction_only():
    assert groups(model(f"{FRICTION}(level=0.5)"), [LOAD, ASYMMETRIC]) == [(LOAD, ASYMMETRIC, OFFSET)]
    assert groups(model(), [LOAD, ASYMMETRIC], FRICTION) == [(LOAD, ASYMMETRIC, OFFSET)]
    assert groups(model("stribeck_friction@motor(coulomb=0.5)"), [LOAD]) == []


def test_friction_that_differs_by_direction_is_two_effects_where_a_fit_found_it_alone():
    both = (f"{FRICTION} + {LOAD}", f"{FRICTION} + {OFFSET}")
    assert groups(model(), [ASYMMETRIC]) == [(ASYMMETRIC, *both)]
    assert groups(model(), [LOAD, ASYMMETRIC]) == [(ASYMMETRIC, *both)]
    # Once the model has one of the constants, the friction beside it is not that one again.
    assert groups(model(f"{OFFSET}(offset=0.1)"), [ASYMMETRIC]) == [(ASYMMETRIC, both[0])]
    # Behind a dead zone an offset is no constant force.
    assert groups(model(f"{DEAD}(width=0.1)"), [ASYMMETRIC]) == [(ASYMMETRIC, both[0])]
    (twins,) = find_equivalent_effects(model(), [ASYMMETRIC])
    assert [text.split()[0] for text in twins.checks] == ["with", "mount"]


@settings(max_examples=30, deadline=None)
@given(level=st.floats(0.05, 1.0), ratio=st.floats(-0.9, 0.9), seed=st.integers(0, 99))
def test_what_is_called_one_equation_moves_the_same(level, ratio, seed):
    time = np.arange(400) * 0.005
    command = np.random.default_rng(seed).standard_normal(40).repeat(10)
    values = {
        "asymmetric_friction": f"level={level}, ratio={ratio}",
        "coulomb_friction": f"level={level}",
        "load_torque": f"torque={-level * ratio}",
        "input_offset": f"offset={-level * ratio / model().values['drive.gain']}",
    }
    (group,) = find_equivalent_effects(model(), [ASYMMETRIC])
    runs = []
    for names in group.names:
        parts = [f"{name}({values[name.partition('@')[0]]})" for name in names.split(" + ")]
        runs.append(simulate(model(*parts), time, command, time).output)
    assert len(runs) == 3
    assert np.ptp(runs[0][:, 0]) > 0.0
    for other in runs[1:]:
        np.testing.assert_allclose(other, runs[0], atol=1e-6)


def test_delays_are_one_with_one_sensor():
    delays = ["input_delay@input", "sensor_delay@position[motor]"]
    both = load_model("dc_motor")
    assert groups(both, delays) == []
    assert groups(replace(both, outputs=both.outputs[:1]), delays) == [tuple(delays)]


def test_what_is_merely_alike_is_left_to_an_experiment():
    assert groups(model(), [DEAD, FRICTION]) == []


def test_each_pair_has_its_check_by_hand():
    (twins,) = find_equivalent_effects(model(f"{FRICTION}(level=0.5)"), [OFFSET, LOAD, ASYMMETRIC])
    assert twins.text.startswith(f"no motion can tell {OFFSET}, {LOAD} and {ASYMMETRIC} apart")
    assert len(twins.checks) == 2
    assert "amplifier" in twins.checks[0]
    assert "the other way round" in twins.checks[1]
    assert without_equivalents((OFFSET, DEAD, LOAD), [twins]) == (OFFSET, DEAD)


def test_rival_models_that_are_one_count_once():
    rivals = [model(f"{OFFSET}(offset=0.1)"), model(f"{LOAD}(torque=0.1)"), model(f"{DEAD}(width=0.1)")]
    kept, twins = equivalent_rivals(rivals)
    assert kept == (0, 2)
    assert twins is not None
    assert twins.names == (OFFSET, LOAD)
    # Two strengths of one effect are two models, and so are two with other free parameters.
    assert equivalent_rivals([rivals[2], model(f"{DEAD}(width=0.2)")]) == ((0, 1), None)
    assert equivalent_rivals([rivals[0].with_free([]), rivals[1]]) == ((0, 1), None)


@pytest.fixture
def ladder() -> Ladder:
    last = model(f"{FRICTION}(level=0.5)", f"{OFFSET}(offset=0.1)")
    added = Candidate("input_offset", "input", "yes", "", "", model=last)
    step = Step(added, last, set=(OFFSET, LOAD, ASYMMETRIC))
    evaluated = Candidate("saturation", "input", "no", "a limit beyond the data cannot show", "")
    names = (LOAD, ASYMMETRIC, OFFSET, "saturation@input", FRICTION)
    return Ladder((Step(None, model()), step), "adequate", candidates=(evaluated,), untestable=names)


def test_the_ties_of_a_ladder_are_held_against_its_last_model(ladder):
    assert [one.names for one in equivalent_effects_of_ladder(ladder)] == [(OFFSET, LOAD, ASYMMETRIC)]
    later = Step(Candidate("dead_zone", "input", "yes", "", ""), ladder.model.with_effects([f"{DEAD}(width=0.1)"]))
    assert [one.names for one in equivalent_effects_of_ladder(replace(ladder, steps=(*ladder.steps, later)))] == [
        (LOAD, ASYMMETRIC)
    ]


def test_what_was_found_or_ties_with_it_is_not_what_the_data_cannot_show(ladder):
    assert undetectable(ladder) == {"saturation@input": "a limit beyond the data cannot show"}
    richer = ladder.steps[0].model.with_effects(["stribeck_friction@motor(coulomb=0.5)"])
    assert undetectable(Ladder((Step(None, richer),), untestable=(FRICTION, DEAD))) == {DEAD: ""}


def test_a_significant_effect_that_was_not_added_is_reported_once(ladder):
    """A limit that begins beyond the data may have left its trace all the same."""
    passed = replace(ladder, passed_over={"saturation@input": "it stands in for something else"})
    assert undetectable(passed) == {}
    assert significant_not_added(passed) == []
    surely = replace(ladder.candidates[0], gain=30.0, p_value=1e-6)
    stopped = replace(ladder, verdict="missing", candidates=(surely,))
    assert [one.name for one in significant_not_added(stopped)] == ["saturation@input"]
    assert undetectable(stopped) == {}


def test_effects_that_nobody_knows_are_none_of_the_others() -> None:
    assert find_equivalent_effects(
        load_model("axis"), ("effect_0@axis", "load_torque@axis", "effect_1@input")
    ) == find_equivalent_effects(load_model("axis"), ("load_torque@axis",))
