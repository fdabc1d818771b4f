from __future__ import annotations

from types import SimpleNamespace
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from tests.robots.conftest import ARMATURE, DRY, JOINTS, VISCOUS, made

from idloop.physics import load_model
from idloop.records import make_stream, write_bag
from idloop.robots.balance import RobotMotion, robot_motions
from idloop.robots.joint_models import effect_torque, effects_of_joints
from idloop.robots.rigid_body import RigidBody

COGGING = (0.15, 9.0, 0.7)


def ripple(q, v):
    amplitude, harmonic, phase = COGGING
    return np.column_stack([np.zeros(len(q)), amplitude * np.sin(harmonic * q[:, 1] + phase)])


@pytest.fixture(scope="module")
def bags(urdf, true_links, tmp_path_factory):
    folder = tmp_path_factory.mktemp("bags")
    found = []
    for seed in (1, 2):
        record = made(urdf, true_links, seed=seed, extra=ripple, noise=0.03)
        joints = {
            joint: {field: getattr(record, field)[:, place] for field in ("position", "velocity", "effort")}
            for place, joint in enumerate(JOINTS)
        }
        stamps = (record.time * 1e9).round().astype(np.int64) + 10**15
        found.append(write_bag(folder / record.name, [make_stream("joint_states", stamps, joints)]))
    return found


@pytest.fixture(scope="module")
def found(urdf, bags):
    from idloop import identify_robot

    return identify_robot(urdf, bags[0], bags[1], workers=0)


def test_effects_of_the_command_are_not_looked_for_behind_the_drive():
    names = effects_of_joints()
    assert {"cogging", "stribeck_friction", "cable_spring"} <= set(names)
    assert not {"dead_zone", "saturation", "input_delay", "thermal_viscosity", "gravity"} & set(names)


def test_the_torque_of_a_friction_at_a_reversal_is_its_own():
    stribeck = "stribeck_friction@axis"
    model = load_model("axis").with_effects([f"{stribeck}(coulomb=0.5,static=0.9,velocity=0.1)"])
    time = np.arange(0.0, 2.0, 0.001)
    q, v, a = (one[:, None] for one in (np.sin(5.0 * time), 5.0 * np.cos(5.0 * time), -25.0 * np.sin(5.0 * time)))
    motion = RobotMotion(SimpleNamespace(time=time), q, v, a, np.array([0.2]), 20.0, 10.0)  # type: ignore[arg-type]
    found = effect_torque(SimpleNamespace(model=model, added=(stribeck,)), motion, 0)  # type: ignore[arg-type]
    np.testing.assert_allclose(found, np.sign(v[:, 0]) * (0.5 + 0.4 * np.exp(-((v[:, 0] / 0.1) ** 2))), atol=1e-9)


@pytest.mark.slow
def test_the_hidden_effect_is_found_at_its_joint_and_none_elsewhere(found):
    assert found.added == {"shoulder": (), "elbow": ("cogging@elbow",)}
    values = found.models["elbow"].values
    assert values["cogging@elbow.amplitude"] == pytest.approx(COGGING[0], abs=0.01)
    assert values["cogging@elbow.harmonic"] == COGGING[1]


@pytest.mark.slow
def test_the_torque_of_an_unseen_record_is_left_with_noise_alone(found):
    unseen = next(one for one in found.robot.errors if one.unseen)
    # White noise of 0.03 N·m at 200 Hz, of which the comparison band passes a tenth of the power.
    assert np.all(unseen.rms < 0.012)
    assert unseen.rigid[1] > 5.0 * unseen.rms[1]
    assert found.robot.fit.own[:, 1] == pytest.approx(VISCOUS, abs=0.01)
    assert found.robot.fit.own[:, 2] == pytest.approx(DRY, abs=0.01)
    assert found.robot.fit.own[1, 0] == pytest.approx(ARMATURE[1], abs=0.005)


@pytest.mark.slow
def test_the_identified_urdf_moves_as_the_machine(found, urdf, true_links, tmp_path):
    path = tmp_path / "identified.urdf"
    path.write_text(found.urdf())
    before, after = RigidBody(urdf), RigidBody(path)
    motion = np.random.default_rng(0).uniform(-1.0, 1.0, size=(3, 200, 2))
    true = before.torque(true_links, *motion)
    # The armature of the shoulder cannot be told from the inertia of its link.
    error = [
        np.std(one - true, axis=0) / np.std(true, axis=0)
        for one in (
            before.torque(before.nominal, *motion),
            after.torque(after.nominal, *motion) + (found.robot.fit.own[:, 0] - ARMATURE) * motion[2],
        )
    ]
    assert np.all(error[1] < 0.02)
    assert error[0][1] > 0.1
    root = ET.fromstring(path.read_text())
    damping = {one.get("name"): one.find("dynamics") for one in root.findall("joint")}
    assert float(damping["elbow"].get("friction")) == pytest.approx(DRY[1], abs=0.01)
    assert damping["flange"] is None
    # The tool is one body with the link before it.
    assert next(one for one in root.findall("link") if one.get("name") == "tool").find("inertial") is None


@pytest.mark.slow
def test_the_results_are_written(found, tmp_path):
    from idloop import load_model

    folder = found.save(tmp_path / "robot")
    assert load_model(folder / "joints" / "elbow.yaml").effect_names == found.models["elbow"].effect_names
    page = (folder / "report.html").read_text()
    assert "cogging" in page
    assert 'id="joint-elbow"' in page
    assert "http://" not in page.partition("<script>")[0].replace("http-equiv", "")
    assert "harmonic 9" in page
    assert "harmonic 9" in found.summary()
    assert found.plot().axes
    assert found.ladder("elbow").added == ("cogging@elbow",)


@pytest.mark.slow
def test_a_joint_that_never_moves_does_not_stop_the_others(urdf, true_links):
    from dataclasses import replace

    from idloop.reporting.text.blocks import as_text
    from idloop.robots.document import document
    from idloop.robots.identify import identify
    from idloop.robots.words import robot_blocks

    robot = RigidBody(urdf)
    record = made(urdf, true_links, noise=0.0)
    (smooth,) = robot_motions([record], [False, False])
    still = np.array([1.0, 0.0])
    q, v, a = smooth.position * still + [0.0, 0.3], smooth.velocity * still, smooth.acceleration * still
    friction = still * (ARMATURE * a + VISCOUS * v + DRY * np.sign(v))
    noise = 0.03 * np.random.default_rng(0).normal(size=q.shape)
    held = replace(record, position=q, velocity=v, effort=robot.torque(true_links, q, v, a) + friction + noise)
    found = identify(robot, [held], [], level=0.01, rounds=2, workers=0, seed=0, report=lambda share, text: None)
    assert found.resting == [1]
    assert found.ladders[0].added == found.ladders[1].added == ()
    assert found.fit.own[0, 1:3] == pytest.approx([VISCOUS[0], DRY[0]], abs=0.02)
    assert np.all(np.abs(found.fit.own) < 10.0)
    text = as_text(robot_blocks(document(found, None, ())))
    assert "elbow: it hardly moves" in text
    assert "next: elbow hardly moves" in text
