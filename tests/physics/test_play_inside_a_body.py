"""Effects of a coupling inside a body that compliance splits, against two bodies that are written as two."""

from __future__ import annotations

import numpy as np
import pytest

from idloop.errors import InputError
from idloop.physics import Engine, Model, kernel, load_model, simulate
from idloop.physics.model_file import build_model
from idloop.physics.schema import read_model_file

NEAR, FAR, STIFFNESS, DAMPING, GAP = 0.004, 0.006, 6.0, 0.01, 0.05
TIME = np.arange(0.0, 4.0, 0.002)
COMMAND = 2.0 * np.sign(np.sin(5.0 * TIME)) * np.abs(np.sin(1.3 * TIME))
GAP_INSIDE, SPRING = "backlash@axis-axis_far", "compliance@axis"
TWO = f"""\
schema: idloop/model/1
name: two
input: {{topic: joint_command, joint: motor, field: effort, unit: N·m}}
outputs:
  - {{topic: joint_states, joint: motor, field: position, unit: rad}}
  - {{topic: joint_states, joint: motor, field: velocity, unit: rad/s}}
  - {{topic: joint_states, joint: load, field: velocity, unit: rad/s}}
bodies:
  - {{name: motor, inertia: {NEAR}, viscous_friction: 0.02}}
  - {{name: load, inertia: {FAR}, viscous_friction: 0.03}}
couplings:
  - {{from: motor, to: load, stiffness: {STIFFNESS}, damping: {DAMPING}}}
effects:
  - {{effect: backlash, at: motor-load, gap: {GAP}}}
"""


def two() -> Model:
    return build_model(read_model_file(TWO, "two.yaml"), "two.yaml")


def one(*effects: str, damping: float = DAMPING) -> Model:
    """The same machine as one body that is split."""
    plain = load_model("axis").with_values({"axis.inertia": NEAR + FAR, "axis.viscous_friction": 0.05})
    split = FAR / (NEAR + FAR)
    spring = f"{SPRING}(stiffness={STIFFNESS},damping={damping},split={split!r},viscous_split=0.6)"
    return plain.with_effects([spring, *effects])


def test_play_inside_a_body_is_play_between_two_bodies() -> None:
    inside = simulate(one(f"{GAP_INSIDE}(gap={GAP})"), TIME, COMMAND, TIME).output
    between = simulate(two(), TIME, COMMAND, TIME).output[:, :2]
    np.testing.assert_allclose(inside, between, rtol=0, atol=1e-12 * np.max(np.abs(between)))
    without = simulate(one(), TIME, COMMAND, TIME).output
    assert np.max(np.abs(inside - without)) > 0.05 * np.max(np.abs(without[:, 1]))


def test_a_gap_of_nothing_is_the_spring_alone() -> None:
    plain = simulate(one(), TIME, COMMAND, TIME).output
    closed = simulate(one(f"{GAP_INSIDE}(gap=0)"), TIME, COMMAND, TIME).output
    np.testing.assert_allclose(closed, plain, rtol=0, atol=1e-9 * np.max(np.abs(plain)))


def test_play_inside_a_body_keeps_momentum_and_without_damping_energy() -> None:
    model = one(f"{GAP_INSIDE}(gap={GAP})", damping=0.0).with_values({"axis.viscous_friction": 0.0})
    engine = Engine(model)
    motion = engine.initial_state()
    motion[kernel.FIRST + 2] = 3.0  # of two positions and two speeds: only the near half turns
    run = engine.simulate(None, np.array([0.0]), np.array([0.0]), TIME, motion)
    # The far half has the momentum that the near one has lost.
    near = run[:, 1]
    far = NEAR * (3.0 - near) / FAR
    twist = run[:, 0] - NEAR * (3.0 * TIME - run[:, 0]) / FAR
    stretch = np.maximum(np.abs(twist) - 0.5 * GAP, 0.0)
    energy = 0.5 * (NEAR * near**2 + FAR * far**2 + STIFFNESS * stretch**2)
    np.testing.assert_allclose(energy, 0.5 * NEAR * 9.0, rtol=1e-4)
    assert np.max(stretch) > GAP
    assert np.any(stretch[1:] == 0.0)


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_a_model_file_keeps_what_acts_inside_a_body_in_any_order(order: tuple[int, int]) -> None:
    texts = [f"{SPRING}(stiffness=6)", f"{GAP_INSIDE}(gap=0.05)"]
    model = load_model("axis").with_effects([texts[i] for i in order])
    again = build_model(read_model_file(model.to_yaml(), "m.yaml"), "m.yaml")
    assert again.effect_names == model.effect_names
    assert again.values == model.values
    assert again.parameter(f"{GAP_INSIDE}.gap").unit == "rad"


def test_what_acts_inside_a_body_goes_with_what_splits_it_and_has_no_place_without() -> None:
    model = one(f"{GAP_INSIDE}(gap=0.05)", "coulomb_friction@axis(level=0.1)")
    assert model.sites("coupling") == ("axis-axis_far",)
    assert model.without_effect(SPRING).effect_names == ("coulomb_friction@axis",)
    assert model.without_effects([SPRING, GAP_INSIDE]).effect_names == ("coulomb_friction@axis",)
    assert load_model("axis").sites("coupling") == ()
    with pytest.raises(InputError, match=r"backlash@axis-axis_far .* add compliance@axis") as caught:
        load_model("axis").with_effects([f"{GAP_INSIDE}(gap=0.05)"])
    assert "\n" not in str(caught.value)


def test_the_far_half_takes_the_name_of_no_other_body() -> None:
    text = TWO.replace("load", "motor_far").replace("name: two", "name: taken")
    model = build_model(read_model_file(text, "m.yaml"), "m.yaml").with_effects(["compliance@motor(stiffness=50)"])
    assert model.sites("coupling") == ("motor-motor_far", "motor-motor_far_far")
    inside = model.with_effects(["backlash@motor-motor_far_far(gap=0.1)"])
    assert Engine(inside).layout().joint_of == {"motor-motor_far_far": 0, "motor-motor_far": 1}
