"""The compiled simulator against motions that are known exactly."""

import numpy as np
import pytest
from scipy.linalg import expm

from idloop.physics import Model, load_model, simulate

TIME = np.arange(0.0, 3.0, 0.01)


@pytest.fixture
def axis() -> Model:
    """One body of inertia 0.5 with viscous friction 0.2, driven by its torque."""
    return load_model("axis").with_values({"axis.inertia": 0.5, "axis.viscous_friction": 0.2})


def test_step_of_a_first_order_speed(axis: Model) -> None:
    run = simulate(axis, [0.0], [1.5], TIME)
    tau = 0.5 / 0.2
    speed = 1.5 / 0.2 * (1.0 - np.exp(-TIME / tau))
    position = 1.5 / 0.2 * (TIME - tau * (1.0 - np.exp(-TIME / tau)))
    np.testing.assert_allclose(run.output[:, 0], position, atol=1e-10)
    np.testing.assert_allclose(run.output[:, 1], speed, atol=1e-10)


def test_coast_down_under_viscous_and_dry_friction_ends_at_rest_and_stays(axis: Model) -> None:
    model = axis.with_effect("coulomb_friction", "axis", level=0.3)
    run = simulate(model, [0.0], [0.0], TIME, velocity=[2.0])
    tau, floor = 0.5 / 0.2, 0.3 / 0.2
    stop = tau * np.log(1.0 + 2.0 / floor)
    speed = np.where(stop > TIME, (2.0 + floor) * np.exp(-TIME / tau) - floor, 0.0)
    np.testing.assert_allclose(run.output[:, 1], speed, atol=1e-9)
    at_rest = run.output[stop < TIME, 0]
    assert np.ptp(at_rest) == 0.0
    assert at_rest[0] == pytest.approx((2.0 + floor) * tau * (1.0 - np.exp(-stop / tau)) - floor * stop, abs=1e-9)


def test_dry_friction_holds_below_its_level_without_creep(axis: Model) -> None:
    model = axis.with_effect("coulomb_friction", "axis", level=0.3)
    command = 0.299999 * np.sign(np.sin(40.0 * TIME))
    run = simulate(model, TIME, command, TIME)
    assert np.all(run.output == 0.0)


def test_breakaway_accelerates_with_what_exceeds_the_level(axis: Model) -> None:
    model = axis.with_values({"axis.viscous_friction": 0.0}).with_effect("coulomb_friction", "axis", level=0.3)
    run = simulate(model, [0.0], [0.8], TIME)
    np.testing.assert_allclose(run.output[:, 0], 0.5 * (0.8 - 0.3) / 0.5 * TIME**2, atol=1e-10)


def test_spring_to_ground_is_a_harmonic_oscillator(axis: Model) -> None:
    model = axis.with_values({"axis.viscous_friction": 0.0}).with_effect(
        "cable_spring", "axis", stiffness=50.0, rest=0.1
    )
    run = simulate(model, [0.0], [0.0], TIME)
    np.testing.assert_allclose(run.output[:, 0], 0.1 - 0.1 * np.cos(10.0 * TIME), atol=2e-5)


@pytest.mark.parametrize("delay", [0.0, 0.004, 0.01, 0.0273, 0.5])
def test_input_delay_of_any_length_shifts_the_answer_exactly(axis: Model, delay: float) -> None:
    model = axis.with_effect("input_delay", "input", delay=delay)
    run = simulate(model, [0.0, 1.0], [1.5, 0.0], TIME)
    late = np.maximum(TIME - delay, 0.0)
    tau = 0.5 / 0.2
    speed = 7.5 * (1.0 - np.exp(-np.minimum(late, 1.0) / tau)) * np.exp(-np.maximum(late - 1.0, 0.0) / tau)
    np.testing.assert_allclose(run.output[:, 1], speed, atol=1e-9)


@pytest.mark.parametrize("delay", [0.004, 0.01, 0.0273, 0.3])
def test_sensor_delay_shows_the_motion_of_before(axis: Model, delay: float) -> None:
    model = axis.with_effect("sensor_delay", "position[axis]", delay=delay)
    run = simulate(model, [0.0], [1.5], TIME)
    late, tau = np.maximum(TIME - delay, 0.0), 0.5 / 0.2
    np.testing.assert_allclose(run.output[:, 0], 7.5 * (late - tau * (1.0 - np.exp(-late / tau))), atol=1e-7)
    np.testing.assert_allclose(run.output[:, 1], 7.5 * (1.0 - np.exp(-TIME / tau)), atol=1e-10)


def test_sensors_that_are_late_together_are_a_command_that_is_late(axis: Model) -> None:
    command = np.sin(5.0 * TIME)
    shown = axis.with_effects(["sensor_delay@position[axis](delay=0.03)", "sensor_delay@velocity[axis](delay=0.05)"])
    same = axis.with_effects(["input_delay@input(delay=0.03)", "sensor_delay@velocity[axis](delay=0.02)"])
    np.testing.assert_allclose(
        simulate(shown, TIME, command, TIME).output, simulate(same, TIME, command, TIME).output, atol=1e-12
    )


def test_actuator_lag_follows_its_exponential(axis: Model) -> None:
    model = axis.with_values({"axis.viscous_friction": 0.0}).with_effect("actuator_lag", "input", time_constant=0.05)
    run = simulate(model, [0.0], [1.0], TIME)
    np.testing.assert_allclose(run.output[:, 1], (TIME - 0.05 * (1.0 - np.exp(-TIME / 0.05))) / 0.5, atol=2e-7)


def test_two_bodies_on_a_spring_turn_about_their_common_centre() -> None:
    model = load_model("axis").with_values({"axis.inertia": 0.4, "axis.viscous_friction": 0.0})
    model = model.with_effect("compliance", "axis", stiffness=30.0, damping=0.0, split=0.25)
    run = simulate(model, [0.0], [2.0], TIME)
    near, far = 0.3, 0.1
    rate = np.sqrt(30.0 * (1.0 / near + 1.0 / far))
    bend = 2.0 * far / (30.0 * (near + far)) * (1.0 - np.cos(rate * TIME))
    expected = 0.5 * 2.0 / 0.4 * TIME**2 + far / (near + far) * bend
    np.testing.assert_allclose(run.output[:, 0], expected, atol=1e-4)


def test_viscous_friction_acts_on_either_side_of_a_spring() -> None:
    axis = load_model("axis").with_values({"axis.inertia": 0.4, "axis.viscous_friction": 0.6})
    values = {"stiffness": 30.0, "damping": 0.02, "split": 0.25}
    proportional = simulate(axis.with_effect("compliance", "axis", **values), [0.0], [2.0], TIME).output
    same = simulate(axis.with_effect("compliance", "axis", **values, viscous_split=0.25), [0.0], [2.0], TIME).output
    np.testing.assert_array_equal(same, proportional)
    found = simulate(axis.with_effect("compliance", "axis", **values, viscous_split=1.0), [0.0], [2.0], TIME).output
    (near, far), viscous = (0.3, 0.1), 0.6
    matrix = np.array([
        [0.0, 0.0, 1.0, 0.0],
        [0.0, 0.0, 0.0, 1.0],
        [-30.0 / near, 30.0 / near, -0.02 / near, 0.02 / near],
        [30.0 / far, -30.0 / far, 0.02 / far, -(0.02 + viscous) / far],
    ])  # fmt: skip
    whole = np.zeros((5, 5))
    whole[:4, :4], whole[2, 4] = matrix, 2.0 / near
    expected = np.array([expm(whole * t)[[0, 2], 4] for t in TIME[::50]])
    np.testing.assert_allclose(found[::50], expected, atol=2e-5)


def test_play_on_the_sensor_follows_the_play_operator(axis: Model) -> None:
    gap = 0.3
    true = simulate(axis, TIME, np.sin(7.0 * TIME), TIME).output[:, 0]
    played = simulate(axis.with_effect("backlash", "position[axis]", gap=gap), TIME, np.sin(7.0 * TIME), TIME)
    fine = np.arange(0.0, TIME[-1] + 1e-6, 1e-5)
    path = simulate(axis, TIME, np.sin(7.0 * TIME), fine).output[:, 0]
    reading, expected, k = path[0], np.empty_like(true), 0
    for time, value in zip(fine, path, strict=True):
        reading = min(max(reading, value - gap / 2), value + gap / 2)
        if k < len(TIME) and time >= TIME[k] - 1e-9:
            expected[k] = reading
            k += 1
    np.testing.assert_allclose(played.output[:, 0], expected, atol=2e-6)
    assert np.max(np.abs(played.output[:, 0] - true)) == pytest.approx(gap / 2, abs=1e-6)


def test_velocity_filter_is_a_first_order_lag(axis: Model) -> None:
    model = axis.with_values({"axis.viscous_friction": 0.0}).with_effect(
        "velocity_filter", "velocity[axis]", time_constant=0.1
    )
    run = simulate(model, [0.0], [0.5], TIME)
    np.testing.assert_allclose(run.output[:, 1], TIME - 0.1 * (1.0 - np.exp(-TIME / 0.1)), atol=1e-9)


def test_dahl_friction_under_slow_pull_is_an_exponential_of_the_displacement(axis: Model) -> None:
    # pulled through a stiff spring-like servo: constant speed, friction force read from the force balance
    from idloop.physics import Engine

    model = axis.with_values({"axis.viscous_friction": 0.0})
    model = model.with_effect("presliding_friction", "axis", level=0.4, stiffness=200.0)
    speed, time = 0.01, np.arange(0.0, 1.0, 0.001)
    motion = (speed * time)[:, None]
    still = np.zeros_like(motion)
    none = np.array([0.0])
    left = Engine(model).balance(None, motion, still + speed, still, none, none, time).residual
    np.testing.assert_allclose(left[1:, 0], 0.4 * (1.0 - np.exp(-200.0 / 0.4 * speed * time[1:])), rtol=2e-3, atol=1e-3)


@pytest.mark.parametrize("beside", ["", "backlash@motor-load1(gap=0.1)", "hardening_stiffness@motor-load1(cubic=50.0)"])
def test_a_slipping_coupling_passes_its_limit_whatever_else_it_does(beside: str) -> None:
    model = load_model("torsion").with_effects(["slip@motor-load1(limit=0.05)", *([beside] if beside else [])])
    time = np.arange(0.0, 30.0, 0.001)
    loads = simulate(model, time, np.full_like(time, 2.0), time).output[-1000:, 1:]
    speed = float(np.mean(np.ptp(loads, axis=0))) / (time[-1] - time[-1000])
    viscous = sum(model.values[f"{body}.viscous_friction"] for body in model.bodies[1:])
    assert speed * viscous == pytest.approx(0.05, rel=0.02)


def test_slip_leaves_the_two_sides_turned() -> None:
    model = load_model("torsion")
    model = model.with_effect("slip", "motor-load1", limit=0.05)
    time = np.arange(0.0, 8.0, 0.001)
    command = np.where(time < 0.2, 2.9, 0.0)
    slipped = simulate(model, time, command, time).output[-1]
    firm = simulate(load_model("torsion"), time, command, time).output[-1]
    assert abs(firm[0] - firm[1]) < 1e-3
    assert slipped[0] - slipped[1] > 0.05
