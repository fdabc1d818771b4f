"""What a compensator cancels: closed forms, invariants, and what it says of the rest."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from idloop.control import build_controller
from idloop.control.compensation import Compensation
from idloop.control.step import smooth_sign
from idloop.errors import InputError
from idloop.exporters.compensator import export_compensation
from idloop.physics import load_model
from idloop.physics.effect import INPUT, built_in
from idloop.physics.model_file import build_model
from idloop.physics.schema import read_model_file

AXIS = load_model("axis")
NONE = {"type": "none"}
PD = {"type": "pd", "output": "axis.position", "kp": 4.0, "kd": 0.3, "sample_time": 0.001}
SPEED = {"type": "p", "output": "axis.velocity", "kp": 1.0, "sample_time": 0.001}
SOME = (
    "dead_zone@input(width=0.3)",
    "input_offset@input(offset=0.1)",
    "gain_asymmetry@input(ratio=0.2)",
    "coulomb_friction@axis(level=0.15)",
    "imbalance@axis(amplitude=0.2,phase=0.4)",
    "cogging@axis(amplitude=0.1,harmonic=6)",
)
ROUGH = st.floats(allow_nan=True, allow_infinity=True)


def build(known, spec=PD, model=AXIS, **options):
    return build_controller(spec, compensation=Compensation(model.with_effects(list(known)), **options))


def drive(model, command):
    """What the drive makes of a command: the forward equations in their order."""
    value = command
    for active in sorted(model.effects, key=lambda one: one.effect.order):
        if active.effect.site == INPUT:
            numbers = [model.values[f"{active.name}.{spec.name}"] for spec in active.effect.parameters
                       if not spec.optional]  # fmt: skip
            numbers += [numbers[0]] * (len(active.effect.parameters) - len(numbers))
            value = active.effect.command(value, 0.0, command, 0.0, [], numbers)
    return value


def along(controller, path):
    """Commands for a reference that is followed exactly."""
    return np.array([controller.step(r, 0.0, [r] * len(controller.inputs)) for r in path])


@given(
    st.floats(-3.0, 3.0),
    st.floats(0.0, 1.0),
    st.floats(-0.5, 0.5),
    st.floats(-0.6, 0.6),
    st.floats(0.01, 0.5),
)
def test_the_drive_does_what_is_wanted_outside_the_smooth_zone(wanted, width, offset, ratio, smooth):
    effects = (f"dead_zone@input(width={width})", f"input_offset@input(offset={offset})",
               f"gain_asymmetry@input(ratio={ratio})")  # fmt: skip
    controller = build(effects, NONE, command_width=smooth)
    command = controller.step(0.0, 0.0, [], wanted)
    got = drive(AXIS.with_effects(list(effects)), command)
    if abs(wanted) >= smooth or width == 0.0:
        assert got == pytest.approx(wanted, abs=1e-9)
    else:
        assert abs(got) <= abs(wanted) + 1e-9


@given(st.floats(0.0, 1.0), st.floats(0.01, 0.5), st.floats(-2.0, 2.0), st.floats(1e-6, 0.1))
def test_the_inverse_of_a_dead_zone_has_no_jump_and_never_falls(width, smooth, wanted, more):
    controller = build([f"dead_zone@input(width={width})"], NONE, command_width=smooth)
    low, high = (controller.step(0.0, 0.0, [], value) for value in (wanted, wanted + more))
    assert 0.0 <= high - low <= more * (1.0 + 1.5 * width / smooth) + 1e-12


@pytest.mark.parametrize("spec", [PD, NONE, SPEED])
@given(samples=st.lists(st.tuples(*[st.floats(-1e3, 1e3)] * 4), min_size=1, max_size=20))
def test_a_model_without_effects_changes_nothing(spec, samples):
    with_, without = build([], spec), build_controller(spec)
    for position, velocity, measured, more in samples:
        y = [measured] * len(without.inputs)
        assert with_.step(position, velocity, y, more) == without.step(position, velocity, y, more)


@pytest.mark.parametrize("effect", [name for name, kinds in built_in().items() if kinds[0].site == "body"])
def test_effects_at_their_neutral_values_change_nothing(effect):
    if effect == "compliance":
        return
    neutral = ",".join(f"{p.name}={p.neutral if p.min <= p.neutral <= p.max else p.start}"
                       for p in built_in()[effect][0].parameters if math.isfinite(p.neutral))  # fmt: skip
    path = np.sin(np.linspace(0.0, 7.0, 300))
    assert np.array_equal(along(build([f"{effect}@axis({neutral})"]), path), along(build_controller(PD), path))


@given(
    samples=st.lists(st.tuples(st.floats(-1e3, 1e3), st.floats(-1e3, 1e3), st.floats(-1e3, 1e3)), max_size=30),
    limit=st.floats(0.01, 10.0),
    share=st.floats(0.01, 1.0),
)
def test_neither_limit_is_passed(samples, limit, share):
    spec = {**PD, "limit": limit}
    one, bare = build(SOME, spec, limit=share * limit), build_controller({**PD, "limit": None})
    for position, measured, more in samples:
        command = one.step(position, 0.0, [measured], more)
        law = bare.step(position, 0.0, [measured], more)
        assert abs(command) <= limit
        assert abs(one.added) <= share * limit
        assert abs(command - min(max(law, -limit), limit)) <= share * limit * (1.0 + 1e-9)


def test_half_of_the_controllers_limit_is_the_default():
    assert build(SOME, {**PD, "limit": 3.0}).settings.limit == 1.5
    assert build(SOME).settings.limit == math.inf
    with pytest.raises(InputError, match=r"limit 4 is above the controller's limit 3"):
        build(SOME, {**PD, "limit": 3.0}, limit=4.0)


@given(st.lists(st.tuples(ROUGH, ROUGH, ROUGH, ROUGH), max_size=10))
def test_what_is_no_number_gives_zero_and_nothing_else(samples):
    controller = build(SOME, {**PD, "limit": 5.0})
    for position, velocity, measured, more in samples:
        command = controller.step(position, velocity, [measured], more)
        assert math.isfinite(command)
        assert controller.fault is None or command == 0.0
    controller.reset()
    assert controller.step(0.0, 0.0, [0.0]) == build(SOME, {**PD, "limit": 5.0}).step(0.0, 0.0, [0.0])


def test_the_noise_of_a_machine_at_rest_does_not_throw_it_over_the_dead_zone():
    model = load_model("dc_motor").with_effects(["dead_zone@input(width=0.5)"])
    spec = {"type": "p", "output": "motor.position", "kp": 6.0, "sample_time": 0.01}
    one = build_controller(spec, compensation=Compensation(model))
    # Two deviations of the noise, times the gain.
    assert one.settings.command_width == pytest.approx(2.0 * 6.0 * 0.0332, rel=0.1)
    noise = 0.0332 * np.random.default_rng(1).standard_normal(500)
    commands = np.array([one.step(0.0, 0.0, [value]) for value in noise])
    assert np.std(commands) < (1.0 + 1.5 * 0.5 / one.settings.command_width) * 6.0 * 0.0332


def test_a_force_is_that_of_the_effects_at_the_reference():
    time = np.arange(400) * 0.001
    path = 0.5 * np.sin(3.0 * time) + 2.0
    got = along(build(["imbalance@axis(amplitude=0.2,phase=0.4)", "load_torque@axis(torque=-0.05)"]), path)
    bare = along(build_controller(PD), path)
    assert np.allclose(got - bare, 0.2 * np.sin(path + 0.4) + 0.05)


def test_the_drive_gain_and_the_feedback_gain_are_taken_out():
    model = AXIS.with_values({}).with_effects(["imbalance@axis(amplitude=0.2,phase=0.0)"])
    model = replace(model, parameters=tuple(replace(p, value=-4.0, min=-9.0) if p.name == "drive.gain" else p
                                            for p in model.parameters))  # fmt: skip
    one = build_controller({**PD, "feedback_gain": 2.0}, compensation=Compensation(model))
    other = build_controller({**PD, "feedback_gain": 2.0})
    assert one.step(3.0, 0.0, [0.0]) - other.step(3.0, 0.0, [0.0]) == pytest.approx(0.2 * math.sin(1.5) / -4.0)


@given(st.floats(0.01, 5.0), st.floats(0.01, 1.0), st.integers(0, 3))
def test_dry_friction_follows_the_reference_not_the_measurement(speed, level, seed):
    time = np.arange(200) * 0.001
    noise = np.random.default_rng(seed).standard_normal(200)
    one, bare = build([f"coulomb_friction@axis(level={level})"], velocity_width=0.005), build_controller(PD)
    added = []
    for t, e in zip(time, noise, strict=True):
        one.step(speed * t, 0.0, [e])
        bare.step(speed * t, 0.0, [e])
        added.append(one.added)
    # The speed is the smaller of two differences: known from the third sample on.
    assert np.allclose(added[3:], level)
    assert max(added) <= level * (1.0 + 1e-9)


def test_dry_friction_goes_over_at_a_reversal_without_a_jump():
    time = np.arange(4000) * 0.001
    one = build(["coulomb_friction@axis(level=0.15)"], velocity_width=0.2)
    added = []
    for r in np.sin(2.0 * time):
        one.step(r, 0.0, [r])
        added.append(one.added)
    speed = np.gradient(np.sin(2.0 * time), 0.001)
    expected = [0.15 * smooth_sign(v, 0.2) for v in speed]
    # From the third sample on, and two samples late: the speed is the smaller of two differences.
    assert np.allclose(added[2:], expected[2:], atol=0.15 * 1.5 * 0.008 / 0.2)


def test_a_step_of_the_reference_is_no_motion():
    one = build(["coulomb_friction@axis(level=0.15)", "quadratic_drag@axis(coefficient=0.1)"])
    for r in [0.0] * 5 + [1.0] * 5 + [-1.0] * 5:
        one.step(r, 0.0, [0.0])
        assert one.added == 0.0


def test_a_velocity_loop_cancels_what_needs_no_position():
    one = build([*SOME, "quadratic_drag@axis(coefficient=0.5)"], SPEED)
    assert set(one.plan.left) == {"imbalance@axis", "cogging@axis"}
    assert "the reference is a velocity" in one.plan.left["cogging@axis"]
    drag = build(["quadratic_drag@axis(coefficient=0.5)"], SPEED)
    drag.step(0.0, -2.0, [0.0])
    assert drag.added == pytest.approx(-0.5 * 4.0)


def test_presliding_friction_is_followed_with_its_memory():
    level, stiffness = 0.15, 300.0
    one = build([f"presliding_friction@axis(level={level},stiffness={stiffness})"])
    added = []
    for k in range(400):
        one.step(1e-5 * k, 0.0, [0.0])
        added.append(one.added)
    way = 1e-5 * np.arange(400)
    # The Dahl model on a way in one direction.
    expected = level * (1.0 - np.exp(-stiffness * way / level))
    assert np.allclose(added, expected, atol=level * 0.05)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_load_dependent_friction_counts_what_the_drive_gives(sign):
    one = build(["load_dependent_friction@axis(ratio=0.2)", "load_torque@axis(torque=-0.5)"], velocity_width=1e-3)
    for k in range(10):
        one.step(sign * 0.01 * k, 0.0, [sign * 0.01 * k])
    law = build_controller(PD)
    for k in range(10):
        command = law.step(sign * 0.01 * k, 0.0, [sign * 0.01 * k])
    assert one.added == pytest.approx((command + 0.5) / (1.0 - sign * 0.2 * np.sign(command + 0.5)) - command, rel=1e-4)


@pytest.mark.parametrize("reads", ["motor", "load1"])
def test_a_gap_is_crossed_once_the_reference_turns_round(reads):
    model = load_model("torsion").with_effects(["backlash@motor-load1(gap=0.02)"])
    spec = {"type": "p", "output": f"{reads}.position", "kp": 1.0, "limit": 2.0, "sample_time": 0.001}
    one = build_controller(spec, compensation=Compensation(model, crossing_time=0.05))
    assert [found.how for found in one.plan.cancelled] == ["shift" if reads == "motor" else "take-up"]
    time = np.arange(2000) * 0.001
    path = 0.3 * np.sin(2.0 * np.pi * time)
    # Measured where the reference is: what is left of the command is the step over the gap.
    moved = along(one, path)
    turning = (time > 0.25) & (time < 0.32)
    if reads == "motor":
        assert np.allclose(moved[(time > 0.1) & (time < 0.24)], 0.01)
        assert np.allclose(moved[(time > 0.4) & (time < 0.7)], -0.01)
        assert np.max(np.abs(np.diff(moved))) < 0.02 * 15.0 / 8.0 / 50.0 * 1.01
    else:
        assert np.all(moved[(time > 0.4) & (time < 0.7)] == 0.0)
        assert moved[turning].min() < 0.0 < moved[turning].max()
        inertia, viscous = 3.11e-5, 2e-3
        way = np.cumsum(np.cumsum(0.0742 * moved[turning]))  # without friction: twice integrated
        assert way[-1] < 0.0
        push = np.sum(0.0742 * moved[turning]) * 0.001
        assert push == pytest.approx(-viscous * 0.02, rel=0.02)
        assert np.max(np.abs(np.diff(moved))) < 3.0 * 60.0 * 0.02 * inertia / 0.0742 / 0.05**2 / 50.0


def test_a_gap_inside_the_body_that_is_read_is_crossed_by_the_reference_and_goes_with_its_spring():
    model = AXIS.with_effects(["compliance@axis(stiffness=20)", "backlash@axis-axis_far(gap=0.02)"])
    one = build_controller(PD, compensation=Compensation(model, crossing_time=0.05))
    assert [(found.active.name, found.how) for found in one.plan.cancelled] == [("backlash@axis-axis_far", "shift")]
    assert list(one.plan.left) == ["compliance@axis"]
    exported = export_compensation(Compensation(replace(model, controller=PD))).text
    kept = build_model(read_model_file(exported, "kept.yaml"), "kept.yaml")
    assert set(kept.effect_names) == set(model.effect_names)


def test_noise_on_a_resting_reference_does_not_cross_the_gap():
    model = load_model("torsion").with_effects(["backlash@motor-load1(gap=0.02)"])
    spec = {"type": "p", "output": "load1.position", "kp": 1.0, "limit": 2.0, "sample_time": 0.001}
    one = build_controller(spec, compensation=Compensation(model))
    noise = 0.00008 * np.random.default_rng(0).uniform(-1.0, 1.0, 500)
    assert np.all(along(one, noise) == 0.0)


def test_a_crossing_stays_within_the_limit():
    model = load_model("torsion").with_effects(["backlash@motor-load1(gap=0.2)"])
    spec = {"type": "p", "output": "load1.position", "kp": 1.0, "limit": 0.2, "sample_time": 0.001}
    one = build_controller(spec, compensation=Compensation(model))
    assert one.settings.crossing_time > 0.02
    added = []
    for r in np.sin(np.arange(4000) * 0.002):
        one.step(r, 0.0, [r])
        added.append(one.added)
    assert 0.0 < np.max(np.abs(added)) <= 0.05 * (1.0 + 1e-9)


def test_a_play_counts_where_the_controller_reads_it():
    model = AXIS.with_effects(["backlash@position[axis](gap=0.02)"])
    assert build_controller(PD, compensation=Compensation(model)).plan.cancelled[0].how == "take-up"
    plan = build_controller(SPEED, compensation=Compensation(model)).plan
    assert list(plan.left) == ["backlash@position[axis]"]


LEFT = {
    "saturation@input(limit=3.0)": "no command brings back",
    "input_delay@input(delay=0.01)": "before the command is known",
    "actuator_lag@input(time_constant=0.01)": "amplifies the noise",
    "sensor_offset@position[axis](offset=0.1)": "acts on the sensor",
    "compliance@axis(stiffness=100.0)": "left to the controller",
}


@pytest.mark.parametrize("effect", LEFT)
def test_what_is_not_cancelled_says_why_in_a_line(effect):
    name = effect.split("(")[0]
    plan = build([effect, "coulomb_friction@axis(level=0.1)"]).plan
    assert LEFT[effect] in plan.left[name]
    assert "\n" not in plan.left[name]
    assert [one.active.name for one in plan.cancelled] == ["coulomb_friction@axis"]
    with pytest.raises(InputError, match="cannot be cancelled"):
        build([effect], effects=(name,))


def test_every_effect_of_the_catalogue_is_cancelled_or_says_why():
    torsion = load_model("torsion")
    sites = {"input": "input", "body": "motor", "coupling": "motor-load1", "output": "position[motor]"}
    spec = {"type": "p", "output": "motor.position", "kp": 1.0, "sample_time": 0.001}
    for name, kinds in built_in().items():
        for kind in kinds:
            if "position" not in kind.outputs or kind.set_point:  # of a sensor, or of a drive that takes no force
                continue
            model = torsion.with_effects([f"{name}@{sites[kind.site]}"])
            plan = build_controller(spec, compensation=Compensation(model)).plan
            assert len(plan.cancelled) + len(plan.left) == 1
            assert all(plan.left.values())


def test_chosen_effects_only():
    one = build(SOME, effects=("dead_zone", "cogging@axis"))
    assert {found.active.name for found in one.plan.cancelled} == {"dead_zone@input", "cogging@axis"}
    assert one.plan.left["coulomb_friction@axis"] == "not requested"
    with pytest.raises(InputError, match="did you mean 'cogging@axis'"):
        build(SOME, effects=("coging@axis",))


@pytest.mark.parametrize("key", ["limit", "velocity_width", "command_width", "crossing_time"])
@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf])
def test_bad_numbers(key, value):
    with pytest.raises(InputError, match=f"compensation: {key} is"):
        build(SOME, **{key: value})


def test_a_controller_of_another_machine():
    with pytest.raises(InputError, match=r"reads motor.position, which is no output of model axis"):
        build(SOME, {**PD, "output": "motor.position"})


@given(st.floats(1.0, 4.0), st.booleans())
def test_a_command_is_taken_over_without_a_bump(command, negative):
    command = -command if negative else command
    spec = {**PD, "type": "pid", "ki": 2.0, "limit": 5.0}
    one = build(SOME, spec, command_width=0.05, limit=5.0)
    one.reset(command)
    assert one.step(0.2, 0.0, [0.1]) == pytest.approx(command, abs=1e-9)


@pytest.mark.parametrize("anti_windup", ["back_calculation", "conditional"])
def test_an_integral_does_not_wind_up_behind_a_compensator(anti_windup):
    spec = {**PD, "type": "pid", "kd": 0.0, "ki": 20.0, "limit": 2.0, "anti_windup": anti_windup}
    one = build(SOME, spec)
    for _ in range(5000):
        assert one.step(1.0, 0.0, [0.0]) == 2.0
    # As soon as the error has changed sign the command leaves the limit.
    for _ in range(50):
        command = one.step(1.0, 0.0, [1.2])
    assert command < 2.0


@given(st.floats(-3.0, 3.0), st.floats(0.01, 2.0))
def test_smooth_sign_is_odd_bounded_and_whole_outside(value, width):
    found = smooth_sign(value, width)
    assert found == -smooth_sign(-value, width)
    assert abs(found) <= 1.0
    assert abs(value) < width or abs(found) == 1.0
    assert smooth_sign(value, 0.0) == np.sign(value)


def test_equation_4_1_of_the_linkoping_thesis():
    # u = (law - 0.0397) / 2.44: gain and offset of the motor current.
    model = load_model("torsion").with_effects([f"input_offset@input(offset={0.0397 / 2.44})"])
    spec = {"type": "none", "sample_time": 0.001, "linearisation": {"gain": 2.44}}
    one = build_controller(spec, compensation=Compensation(model))
    assert one.step(0.0, 0.0, [], 1.0) == pytest.approx((1.0 - 0.0397) / 2.44)
