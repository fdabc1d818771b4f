"""Candidates that replace another effect, or the simple form of their own."""

from __future__ import annotations

from dataclasses import replace

from idloop.diagnosis.screening.proposals import proposals
from idloop.physics import load_model
from idloop.physics.trial import Scales

DAHL = "presliding_friction@axis(level=0.2,stiffness=300,damping=0.1)"
LUGRE = "presliding_friction@axis(level=0.2,stiffness=300,static=0.3,velocity=0.1,damping=0.1)"

SCALES = Scales(
    **dict.fromkeys(Scales.__dataclass_fields__, 1.0) | {"dry": 0.2, "angle": True}  # type: ignore[arg-type]
)


def found(model):
    return {one.name: one for one in proposals(model)}


def test_bristles_are_proposed_in_their_full_form_where_the_model_has_the_simple_one():
    model = load_model("axis").with_effects([DAHL])
    fuller = found(model)["presliding_friction@axis"]
    assert fuller.replaces == "presliding_friction@axis"
    assert "presliding_friction@axis" not in fuller.base.effect_names


def test_the_full_form_is_searched_from_the_values_of_the_simple_one():
    model = load_model("axis").with_effects([DAHL])
    fuller = found(model)["presliding_friction@axis"]
    (trial, *_), *_ = fuller.alternatives(SCALES)
    assert {"level": 0.2, "stiffness": 300.0}.items() <= trial.items()
    assert trial["static"] > trial["level"]
    assert {f"presliding_friction@axis.{name}" for name in trial} <= set(fuller.model(trial).free)


def test_the_fuller_form_is_not_offered_beside_itself():
    assert "presliding_friction@axis" not in found(load_model("axis").with_effects([LUGRE]))
    plain = found(load_model("axis"))["presliding_friction@axis"]
    assert plain.replaces is None
    assert set(plain.alternatives(SCALES)[0][0]) == {"level", "stiffness"}


def test_a_spring_winds_up_as_far_as_a_joint_turns_behind_a_gear():
    spring = found(load_model("axis"))["cable_spring@axis"]
    assert spring.alternatives(replace(SCALES, turns=150.0))
    assert not spring.alternatives(replace(SCALES, turns=500.0))
