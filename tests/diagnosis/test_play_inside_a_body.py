"""Backlash that only a motor encoder measures: the spring first, then the backlash inside it."""

from __future__ import annotations

import re

import numpy as np
import pytest

from idloop.diagnosis.diagnosis import split_body_findings
from idloop.diagnosis.model_errors import explains_less
from idloop.diagnosis.refine import refine
from idloop.diagnosis.screening.proposals import proposals
from idloop.physics import Model, load_model
from idloop.physics.model_file import build_model
from idloop.physics.schema import read_model_file
from idloop.records import Record

MOTOR, LOAD, STIFFNESS, DAMPING, GAP = 0.004, 0.005, 12.6, 0.01, 0.02
STEP, SAMPLES, SUBSTEPS, COUNT = 0.004, 2500, 40, 2.0 * np.pi / 20000
SPRING, PLAY = "compliance@motor", "backlash@motor-motor_far"
EFFECTS = ["compliance", "backlash", "hardening_stiffness", "input_delay", "coulomb_friction", "presliding_friction"]
ONE_BODY = """\
schema: idloop/model/1
name: geared
input: {topic: command, joint: motor, field: effort, unit: N·m}
outputs:
  - {topic: states, joint: motor, field: position, unit: rad}
bodies:
  - {name: motor, inertia: {value: 0.008}, viscous_friction: {value: 0.03}}
"""


def one_body() -> Model:
    return build_model(read_model_file(ONE_BODY, "geared.yaml"), "geared.yaml")


def geared(seed: int, gap: float) -> Record:
    """Counts of a motor's encoder under random steps, a load behind a gear with play: semi-implicit Euler, 0.1 ms."""
    rng = np.random.default_rng(seed)
    levels = rng.choice([-1.0, -0.6, -0.3, 0.0, 0.3, 0.6, 1.0], SAMPLES)
    command = np.repeat(levels, rng.integers(25, 75, SAMPLES))[:SAMPLES]
    torque = np.zeros(SAMPLES)
    for i in range(1, SAMPLES):
        torque[i] = 0.9 * torque[i - 1] + rng.normal()
    torque = command + torque * 0.01 * np.std(command) / np.std(torque)
    x = v = far = speed = 0.0
    h, half, angle = STEP / SUBSTEPS, 0.5 * gap, []
    for drive in torque.tolist():
        angle.append(x)
        for _ in range(SUBSTEPS):
            twist = x - far
            stretch = twist - half if twist > half else twist + half if twist < -half else 0.0
            passed = STIFFNESS * stretch + DAMPING * (v - speed) if stretch or not gap else 0.0
            v += h * (drive - 0.02 * v - passed) / MOTOR
            speed += h * (passed - 0.02 * speed) / LOAD
            x, far = x + h * v, far + h * speed
    reading = COUNT * np.floor((np.array(angle) + 1e-4 * rng.normal(size=SAMPLES)) / COUNT + 0.5)
    time = STEP * np.arange(SAMPLES)
    return Record(
        f"run{seed}", time, command, time, reading[:, None], "motor.effort", "N·m", ("motor.position",), ("rad",)
    )


@pytest.mark.slow
def test_backlash_is_found_after_the_spring_and_a_finding_gives_the_two_bodies():
    ladder = refine(one_body(), [geared(0, GAP)], effects=EFFECTS)
    assert ladder.added == (SPRING, PLAY)
    gap = ladder.model.parameter(f"{PLAY}.gap")
    assert gap.unit == "rad"
    assert gap.value == pytest.approx(GAP, rel=0.02)
    for name, value in {"stiffness": STIFFNESS, "split": LOAD / (MOTOR + LOAD)}.items():
        assert ladder.model.values[f"{SPRING}.{name}"] == pytest.approx(value, rel=0.02)
    (line,) = (line for line in ladder.findings if line.startswith(SPRING))
    assert re.search(r"splits motor into two bodies \(inertia 0\.00[34]\d* and 0\.00[45]\d* kg·m², stiffness 1\d", line)
    assert "\n" not in line


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
def test_a_spring_without_play_gets_no_play(seed: int):
    ladder = refine(one_body(), [geared(seed, 0.0)], effects=EFFECTS)
    assert ladder.added == (SPRING,)
    assert PLAY in {one.name for one in ladder.candidates}


def test_play_is_a_candidate_once_a_body_is_split_and_the_fuller_spring_keeps_it():
    plain = load_model("axis")
    assert not any("axis-axis_far" in one.name for one in proposals(plain))
    split = plain.with_effects(["compliance@axis(stiffness=6)"])
    offered = {one.name: one for one in proposals(split)}
    assert {"backlash@axis-axis_far", "hardening_stiffness@axis-axis_far", "slip@axis-axis_far"} <= set(offered)
    played = offered["backlash@axis-axis_far"].model({"gap": 0.02})
    assert played.free[-1] == "backlash@axis-axis_far.gap"
    fuller = {one.name: one for one in proposals(played)}["compliance@axis"]
    assert fuller.replaces == "compliance@axis"
    both = fuller.model({"stiffness": 6.0, "damping": 0.01, "split": 0.5, "viscous_split": 0.1})
    assert set(both.effect_names) == {"compliance@axis", "backlash@axis-axis_far"}
    assert both.values["backlash@axis-axis_far.gap"] == 0.02


def test_the_free_run_decides_where_an_effect_splits_a_body():
    record = geared(3, 0.0)
    spring = f"{SPRING}(damping={DAMPING},split={LOAD / (MOTOR + LOAD)},stiffness="
    whole = one_body().with_values({"motor.inertia": MOTOR + LOAD, "motor.viscous_friction": 0.04})
    assert not explains_less(whole, whole.with_effects([f"{spring}{STIFFNESS})"]), [record])
    assert explains_less(whole, whole.with_effects([f"{spring}{0.02 * STIFFNESS})"]), [record])


def test_bodies_that_are_split_already_or_stiff_give_no_finding():
    split = load_model("axis").with_effects(["compliance@axis(stiffness=6)"])
    assert split_body_findings(split, ()) == []
    assert split_body_findings(split, ["coulomb_friction@axis"]) == []
    assert len(split_body_findings(split, ["compliance@axis"])) == 1
    assert split_body_findings(load_model("axis").with_effects(["compliance@axis"]), ["compliance@axis"]) == []
