"""Drives with a loop of their own: closed forms, limits, profiles, and what a model file may say."""

import pickle
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from scipy.linalg import expm

import idloop
from idloop.errors import InputError
from idloop.estimation.dataset import prepare
from idloop.estimation.force_balance.weak_form import NARROWEST, weak_form
from idloop.estimation.optimisation.caching_engine import CachingEngine
from idloop.physics import Engine, simulate
from idloop.physics.model_file import from_text
from idloop.physics.plant import Plant

TIME = np.arange(0.0, 2.0, 0.002)
VELOCITY, POSITION = "kind: velocity_loop, proportional: 0.3", "kind: position_loop, proportional: 8.0, derivative: 0.1"


def servo(drive, *effects, unit="rad", inertia="0.02", viscous="0.05"):
    text = f"""
schema: idloop/model/1
name: servo
input: {{joint: arm, field: position, unit: {unit}}}
outputs: [{{joint: arm, field: position, unit: rad}}, {{joint: arm, field: velocity, unit: rad/s}}]
bodies: [{{name: arm, inertia: {inertia}, viscous_friction: {viscous}}}]
drive: {{{drive}}}
"""
    return from_text(text, None).with_effects(effects)


def driven(matrix, entering, time=TIME):
    """Motion from rest under a constant entering: the linear system in closed form."""
    n = len(matrix)
    whole = np.zeros((n + 1, n + 1))
    whole[:n, :n], whole[:n, n] = matrix, entering
    step = expm(whole * (time[1] - time[0]))
    states = [np.append(np.zeros(n), 1.0)]
    for _ in time[1:]:
        states.append(step @ states[-1])
    return np.array(states)[:, :n]


def test_a_position_loop_is_a_spring_and_a_damper_to_its_set_point():
    run = simulate(servo("kind: position_loop, proportional: 8.0, derivative: 0.1, gain: 2.0"), [0.0], [0.5], TIME)
    matrix = np.array([[0.0, 1.0], [-16.0 / 0.02, -(0.05 + 0.2) / 0.02]])
    np.testing.assert_allclose(run.output, driven(matrix, [0.0, 8.0 / 0.02]), atol=2e-5)


def test_a_velocity_loop_approaches_its_set_point():
    run = simulate(
        servo("kind: velocity_loop, proportional: 0.3, feed_forward: 0.05", unit="rad/s"), [0.0], [2.0], TIME
    )
    np.testing.assert_allclose(run.output[:, 1], 2.0 * (1.0 - np.exp(-0.35 / 0.02 * TIME)), atol=1e-6)


def test_an_integral_leaves_no_error_under_a_load():
    drive = "kind: position_loop, proportional: 8.0, derivative: 0.3, integral: 40.0"
    run = simulate(servo(drive, "load_torque@arm(torque=0.4)"), [0.0], [0.5], TIME)
    matrix = np.array([[0.0, 1.0, 0.0], [-8.0 / 0.02, -0.35 / 0.02, 40.0 / 0.02], [-1.0, 0.0, 0.0]])
    exact = driven(matrix, [0.0, (8.0 * 0.5 + 0.4) / 0.02, 0.5])
    np.testing.assert_allclose(run.output, exact[:, :2], atol=1e-3)
    assert simulate(servo(drive, "load_torque@arm(torque=0.4)"), [0.0], [0.5], [0.0, 9.0]).output[
        1, 0
    ] == pytest.approx(0.5, abs=1e-6)


def test_the_integral_of_a_limited_loop_does_not_wind_up():
    drive = "kind: position_loop, proportional: 2.0, derivative: 0.25, integral: 20.0"
    long = np.arange(0.0, 12.0, 0.002)
    inside = simulate(servo(f"{drive}, limit: 0.3"), [0.0], [3.0], long).output[:, 0]
    behind = simulate(servo(drive, "saturation@input(limit=0.3)"), [0.0], [3.0], long).output[:, 0]
    assert inside.max() < 3.6 < behind.max()


def test_the_output_of_a_loop_is_limited():
    run = simulate(
        servo("kind: position_loop, proportional: 50.0, limit: 0.4", viscous="0.0"), [0.0], [5.0], TIME[:100]
    )
    np.testing.assert_allclose(run.output[:, 1], 0.4 / 0.02 * TIME[:100], rtol=1e-6)


def test_a_dead_band_lets_small_errors_be():
    run = simulate(servo("kind: position_loop, proportional: 50.0, dead_band: 0.1"), [0.0], [0.09], TIME)
    assert np.all(run.output == 0.0)


def test_a_profile_limits_velocity_and_acceleration_of_the_set_point():
    stiff = "kind: position_loop, proportional: 2000.0, derivative: 10.0"
    run = simulate(servo(f"{stiff}, profile_velocity: 2.0, profile_acceleration: 8.0"), [0.0], [2.0], TIME)
    expected = np.where(TIME < 0.25, 4.0 * TIME**2, np.where(TIME < 1.0, 0.25 + 2.0 * (TIME - 0.25), np.nan))
    expected = np.where(TIME >= 1.0, 2.0 - 4.0 * np.maximum(1.25 - TIME, 0.0) ** 2, expected)
    # The loop follows its profile late by derivative over proportional.
    np.testing.assert_allclose(run.output[:, 0], np.interp(TIME - 0.005, TIME, expected, left=0.0), atol=0.02)
    assert run.output[:, 1].max() < 2.1
    ramp = simulate(servo(f"{stiff}, profile_velocity: 2.0"), [0.0], [1.0], TIME).output[:, 0]
    np.testing.assert_allclose(ramp, np.clip(2.0 * (TIME - 0.005), 0.0, 1.0), atol=0.02)


def test_a_late_loop_is_less_damped():
    plain = servo("kind: position_loop, proportional: 20.0, derivative: 0.2")
    late = servo("kind: position_loop, proportional: 20.0, derivative: 0.2, sample_time: 0.004, delay: 0.003")
    a, b = (Engine(model).linearise().A for model in (plain, late))
    assert (b - a)[1, 1] == pytest.approx(20.0 * 0.005 / 0.02)
    overshoot = [simulate(model, [0.0], [1.0], TIME).output[:, 0].max() for model in (plain, late)]
    assert overshoot[0] < overshoot[1]


@pytest.mark.parametrize(
    ("drive", "unit"),
    [
        ("kind: position_loop, proportional: 20.0, derivative: 0.2", "rad"),
        ("kind: velocity_loop, proportional: 0.3", "rad/s"),
    ],
)
def test_the_linear_part_is_that_of_the_free_run(drive, unit):
    model = servo(drive, unit=unit)
    linear = Engine(model).linearise()
    np.testing.assert_allclose(
        simulate(model, [0.0], [1.0], TIME).output, driven(linear.A, linear.B) @ linear.C.T, atol=1e-4
    )


def test_a_model_with_a_loop_keeps_its_file_and_travels_between_processes():
    model = servo("kind: position_loop, unit: V, gain: 0.1, proportional: {value: 20.0, min: 1.0}, limit: 12.0")
    for again in (from_text(model.to_yaml(), None), pickle.loads(pickle.dumps(model))):
        assert again.to_yaml() == model.to_yaml()
    assert model.parameter("drive.proportional").unit == "V/rad"
    assert model.parameter("drive.limit").unit == "V"
    assert model.parameter("drive.gain").unit == "N·m/V"
    assert model.free == ("drive.proportional",)


@pytest.mark.parametrize(
    ("drive", "unit", "words"),
    [
        ("proportional: 2.0", "N·m", "'proportional' belongs to a loop: add 'kind: position_loop'"),
        ("unit: V", "N·m", "'unit' belongs to a loop"),
        ("kind: position_loop", "rad", "needs 'proportional'"),
        ("kind: position_loop, proportional: 1.0, feed_forward: 1.0", "rad", "has no 'feed_forward'"),
        ("kind: position_loop, proportional: 1.0", "rad/s", "set-point of a position loop is in rad"),
        ("kind: velocity_loop, proportional: 1.0", "rad", "set-point of a velocity loop is in rad/s"),
        ("kind: position_loop, proportional: -1.0", "rad", "drive.proportional: must be >= 0"),
        ("kind: position_loop, unit: volts, proportional: 1.0", "rad", "unknown unit 'volts'"),
        ("kind: positon_loop, proportional: 1.0", "rad", "kind"),
    ],
)  # fmt: skip
def test_a_drive_that_cannot_be_is_refused_in_one_line(drive, unit, words):
    with pytest.raises(InputError, match=words) as caught:
        servo(drive, unit=unit)
    assert "\n" not in str(caught.value)


def test_mujoco_moves_as_the_model_does():
    model = servo("kind: position_loop, unit: N·m, proportional: 4.0, derivative: 0.1", "saturation@input(limit=0.8)")
    machine = mujoco.MjModel.from_xml_string(idloop.export(model, "mujoco").text)
    machine.opt.timestep = 1e-4
    data = mujoco.MjData(machine)
    data.ctrl[0] = 0.7
    moved = []
    for _ in TIME[:300]:
        moved.append(data.qpos[0])
        mujoco.mj_step(machine, data, 20)
    np.testing.assert_allclose(moved, simulate(model, [0.0], [0.7], TIME[:300]).output[:, 0], atol=2e-3)


@pytest.mark.parametrize("proportional", [6.0, 18.0, 50.0])
def test_the_machine_does_not_depend_on_the_gain_of_the_loop(proportional):
    random, time = np.random.default_rng(3), np.arange(0.0, 12.0, 0.005)
    drive = f"kind: position_loop, unit: N·m, proportional: {proportional}, derivative: 0.2"
    model = servo(drive, "coulomb_friction@arm", "gravity@arm", inertia="{value: 0.05}", viscous="{value: 0.01}")
    truth = {"inertia": 0.02, "viscous_friction": 0.05}
    true = model.with_values(
        {f"arm.{name}": value for name, value in truth.items()}
        | {"coulomb_friction@arm.level": 0.12, "gravity@arm.moment": 0.9}
    )
    set_point = np.interp(time, np.arange(0.0, 13.0), random.uniform(-1.0, 1.0, 13)) + 0.3 * np.sin(12.0 * time)
    measured = simulate(true, time, set_point, time).output + random.normal(0.0, [2e-4, 0.01], (len(time), 2))
    outputs = {"position": measured[:, 0], "velocity": measured[:, 1]}
    fitted = idloop.fit(model, idloop.Record.from_arrays(time, set_point, outputs, model))
    for name in model.free:
        if name != "gravity@arm.lowest":
            assert fitted.values[name] == pytest.approx(true.values[name], rel=0.03), name


def test_a_balance_with_an_integral_is_the_same_for_a_second_look_at_its_windows():
    model = servo("kind: position_loop, proportional: 8.0, derivative: 0.3, integral: 40.0", viscous="{value: 0.05}")
    run = simulate(model, TIME, np.sin(5.0 * TIME), TIME)
    outputs = {"position": run.output[:, 0], "velocity": run.output[:, 1]}
    record = idloop.Record.from_arrays(TIME, np.sin(5.0 * TIME), outputs, model)
    form = weak_form(CachingEngine(model), prepare(model, [record]), NARROWEST)
    first = form.residual(model.theta, 0.0)
    np.testing.assert_array_equal(form.with_rest_speed(form.rest_speed).residual(model.theta, 0.0), first)


@pytest.mark.parametrize(("drive", "unit"), [(POSITION, "rad"), (VELOCITY, "rad/s")])
@pytest.mark.parametrize("effect", [[], ["load_dependent_friction@arm(ratio=0.2)"]])
def test_a_balance_with_an_integral_leaves_nothing_of_the_force_of_its_own_model(drive, unit, effect):
    time = np.arange(0.0, 8.0, 0.005)
    model = servo(f"{drive}, integral: 12.0", *effect, unit=unit, viscous="{value: 0.05}")
    set_point = 0.8 * np.sin(3.0 * time) + 0.4 * np.sin(7.0 * time)
    run = simulate(model, time, set_point, time).output[200:]
    outputs = {"position": run[:, 0], "velocity": run[:, 1]}
    record = idloop.Record.from_arrays(time[200:] - time[200], set_point[200:], outputs, model)
    form = weak_form(CachingEngine(model), prepare(model, [record]), NARROWEST)
    assert np.std(form.residual(model.theta, 0.0)) < 0.01 * np.std(form.drive(model.theta, 0.0))


@pytest.mark.parametrize("kind", ["position", "velocity"])
@pytest.mark.parametrize("criterion", ["simulation", "force"])
def test_an_integral_that_does_not_start_at_zero_leaves_the_physics_as_they_are(criterion, kind):
    random, time = np.random.default_rng(0), np.arange(0.0, 20.0, 0.005)
    speed = kind == "velocity"
    drive = f"kind: {kind}_loop, unit: N·m, " + (
        "proportional: 1.2, integral: 8.0" if speed else "proportional: 12.0, derivative: 0.4, integral: 30.0"
    )
    model = servo(
        drive, "gravity@arm", "coulomb_friction@arm", unit="rad/s" if speed else "rad", inertia="{value: 0.05}",
        viscous="{value: 0.01}",
    )  # fmt: skip
    truth = {"arm.inertia": 0.02, "arm.viscous_friction": 0.05, "coulomb_friction@arm.level": 0.12}
    true = model.with_values({**truth, "gravity@arm.moment": 0.9})
    wander = np.interp(time, np.arange(0.0, 21.0), random.uniform(-1.0, 1.0, 21))
    set_point = wander + (np.sin(4.0 * time) + np.sin(20.0 * time) if speed else 0.7 + 0.1 * np.sin(12.0 * time))
    measured = simulate(true, time, set_point, time).output + random.normal(0.0, [2e-5, 0.001], (len(time), 2))
    later = time >= 6.0
    outputs = {"position": measured[later, 0], "velocity": measured[later, 1]}
    record = idloop.Record.from_arrays(time[later] - 6.0, set_point[later], outputs, model)
    fitted = idloop.fit(model, record, criterion=criterion)
    assert fitted.values["gravity@arm.moment"] == pytest.approx(0.9, rel=0.01)
    assert fitted.values["coulomb_friction@arm.level"] == pytest.approx(0.12, rel=0.02)
    assert fitted.values["arm.inertia"] == pytest.approx(0.02, rel=0.03)


@pytest.mark.parametrize(
    ("drive", "unit"),
    [
        ("kind: position_loop, unit: N·m, proportional: {p}, derivative: {d}", "rad"),
        ("kind: velocity_loop, unit: N·m, proportional: {p}, integral: {i}", "rad/s"),
    ],
)
@pytest.mark.parametrize("inertia_known", [True, False])
def test_gains_of_which_a_tenth_is_assumed_are_found_or_their_ratios_are(drive, unit, inertia_known):
    random, time = np.random.default_rng(3), np.arange(0.0, 10.0, 0.005)
    known = drive.format(p=8.0, d=0.2, i=4.0) if unit == "rad" else drive.format(p=0.5, d=0.0, i=4.0)
    # The derivative shows only together with the viscous friction.
    tenth = {"p": "{value: %g, min: 0}" % (0.8 if unit == "rad" else 0.05), "d": 0.2, "i": "{value: 0.4, min: 0}"}
    if not inertia_known:
        tenth["d"] = "{value: 0.02, min: 0}"
    effects = ["coulomb_friction@arm", "gravity@arm"]
    true = servo(known, *effects, unit=unit)
    true = true.with_values({"coulomb_friction@arm.level": 0.12, "gravity@arm.moment": 0.43})
    set_point = np.interp(time, np.arange(0.0, 11.0), random.uniform(-1.0, 1.0, 11)) + 0.3 * np.sign(np.sin(4.0 * time))
    set_point *= 1.0 if unit == "rad" else 4.0
    measured = simulate(true, time, set_point, time).output + random.normal(0.0, [2e-4, 0.01], (len(time), 2))
    model = servo(
        drive.format(**tenth), *effects, unit=unit, viscous="0.05" if not inertia_known else "{value: 0.01}",
        inertia="0.02" if inertia_known else "{value: 0.2}",
    )  # fmt: skip
    if not inertia_known:
        model = model.with_free([*model.free, "arm.viscous_friction"])
    outputs = {"position": measured[:, 0], "velocity": measured[:, 1]}
    fitted = idloop.fit(model, idloop.Record.from_arrays(time, set_point, outputs, model), criterion="simulation")
    scale = fitted.model.values["arm.inertia"] / 0.02
    assert (scale == pytest.approx(1.0)) is inertia_known
    assert ("only the ratios of" in fitted.summary()) is not inertia_known
    for name in ("drive.proportional", "coulomb_friction@arm.level", "gravity@arm.moment"):
        assert fitted.values[name] / scale == pytest.approx(true.values[name], rel=0.03), name


@pytest.mark.parametrize("name", ["friction_compensation", "friction_feed_forward"])
def test_a_compensated_friction_is_smaller_by_what_the_drive_adds(name):
    effects = ["coulomb_friction@arm(level=0.12)", f"{name}@input(level=0.08,speed=0.01)"]
    run = simulate(servo(VELOCITY, *effects, unit="rad/s"), [0.0], [2.0], TIME).output
    assert run[-1, 1] == pytest.approx((0.3 * 2.0 - 0.04) / 0.35, rel=1e-6)
    # A ramp is followed late by what the forces of a constant speed need.
    ramp = simulate(servo(POSITION, *effects), TIME, 1.5 * TIME, TIME).output
    late = (1.5 * (0.05 + 0.1) + 0.04) / 8.0
    assert 1.5 * (TIME[-1] - 0.001) - ramp[-1, 0] == pytest.approx(late, abs=2e-4)


@pytest.mark.parametrize(
    "effect", ["friction_compensation@input(level=0.08)", "friction_feed_forward@input(level=0.08)"]
)
def test_the_views_of_a_compensated_drive_agree(effect):
    model = servo(POSITION, effect)
    set_point = 0.4 * np.sin(3.0 * TIME) + 0.1 * np.sin(11.0 * TIME)
    run = simulate(model, TIME, set_point, TIME).output
    engine = Engine(model)
    assert np.max(np.abs(engine.predict(None, TIME, set_point, TIME, run, np.zeros((3, 2))))) < 1e-9
    # The mean of the held set-points before and after each instant.
    acceleration, around = np.gradient(run[:, 1], TIME), 0.5 * (set_point + np.append(0.0, set_point[:-1]))
    balance = engine.balance(None, run[:, :1], run[:, 1:], acceleration[:, None], TIME, around, TIME)
    assert np.sqrt(np.mean(balance.residual[50:-1] ** 2)) < 0.005 * np.sqrt(np.mean(balance.applied**2))
    plant = Plant(model, noise=False)
    stepped = []
    for instant, command in zip(TIME[:300], set_point, strict=False):
        plant.advance(instant)
        stepped.append(plant.measure()[0])
        plant.schedule(instant, command)
    np.testing.assert_allclose(stepped, run[:300, 0], atol=1e-6)


def test_a_compensation_by_the_set_point_needs_a_loop():
    with pytest.raises(InputError, match="follows the set-point of a loop in the drive: add `kind:`"):
        idloop.load_model("dc_motor").with_effects(["friction_feed_forward@input(level=0.1)"])


@pytest.mark.parametrize(
    ("effect", "parameter", "value"),
    [
        ("friction_compensation@input(level=0.08,speed=0.07)", "speed", 0.07),
        ("friction_feed_forward@input(level=0.08)", "level", 0.08),
    ],
)
@pytest.mark.slow
def test_a_compensation_in_the_firmware_is_told_from_friction(effect, parameter, value):
    random, time = np.random.default_rng(1), np.arange(0.0, 15.0, 0.005)
    drive = "kind: position_loop, unit: N·m, proportional: 12.0, derivative: 0.2"
    friction = "coulomb_friction@arm(level=0.12)"
    set_point = np.interp(time, np.arange(0.0, 16.0), random.uniform(-1.0, 1.0, 16)) + 0.1 * np.sin(12.0 * time)
    measured = simulate(servo(drive, friction, effect), time, set_point, time).output
    measured += random.normal(0.0, [2e-4, 0.01], measured.shape)
    model = servo(drive, friction, inertia="{value: 0.05}", viscous="{value: 0.01}")
    record = idloop.Record.from_arrays(time, set_point, {"position": measured[:, 0], "velocity": measured[:, 1]}, model)
    name = effect.partition("(")[0]
    model, both = idloop.fit(model, record).model, ["friction_compensation", "friction_feed_forward"]
    assert idloop.diagnose(model, record, effects=both).to_dict()["set"] == [name]
    values = idloop.fit(model.with_effects([effect]), record, criterion="simulation").values
    assert values["coulomb_friction@arm.level"] == pytest.approx(0.12, abs=0.005)
    assert values[f"{name}.{parameter}"] == pytest.approx(value, rel=0.1)


def test_nothing_is_cancelled_where_no_force_can_be_sent():
    model = servo("kind: position_loop, proportional: 4.0", "coulomb_friction@arm(level=0.1)")
    law = {"type": "p", "output": "arm.position", "kp": 1.0, "feedback_gain": 1.0, "sample_time": 0.001}
    with pytest.raises(InputError, match="has a loop of its own"):
        idloop.compensate(replace(model, controller=law))


@pytest.mark.parametrize("form", ["mujoco", "control"])
def test_what_an_export_lacks_of_a_loop_is_said(form):
    lost = "\n".join(idloop.export(servo("kind: position_loop, proportional: 4.0, integral: 3.0"), form).left_out)
    assert "drive.integral 3" in lost
    assert "loop in the drive" not in "\n".join(
        idloop.export(servo("kind: position_loop, proportional: 4.0"), form).left_out
    )
