"""Exact slopes of free runs against differences of runs."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from idloop.physics import Engine, load_model

TIME = np.arange(0.0, 3.0, 0.001)
EFFECTS = [
    "coulomb_friction@motor(level=0.6)",
    "asymmetric_friction@motor(level=0.6, ratio=0.3)",
    "stribeck_friction@motor(coulomb=0.6, static=0.9, velocity=0.4)",
    "load_dependent_friction@motor(ratio=0.1)",
    "quadratic_drag@motor(coefficient=0.2)",
    "asymmetric_viscous_friction@motor(coefficient=0.6)",
    "load_torque@motor(torque=0.4)",
    "imbalance@motor(amplitude=0.5, phase=0.3)",
    "cable_spring@motor(stiffness=0.7, rest=0.2)",
    "cogging@motor(amplitude=0.4, harmonic=7.0, phase=0.3)",
    "gain_asymmetry@input(ratio=0.2)",
    "dead_zone@input(width=0.2)",
    "saturation@input(limit=0.5)",
    "input_offset@input(offset=0.1)",
]


def smooth_command(seed, stamps=TIME):
    """A sum of sines: a step of the command decides nothing about when a body breaks away."""
    random = np.random.default_rng(seed)
    waves = [a * np.sin(w * stamps + p) for a, w, p in random.uniform([0.2, 2.0, 0.0], [0.7, 15.0, 6.0], (3, 3))]
    return np.sum(waves, axis=0)


def of(model, command, stamps=TIME, command_stamps=None, start=(0.3, 0.8), change=None):
    engine, theta = Engine(model), model.theta
    change = 1e-6 * np.maximum(np.abs(theta), 0.1) if change is None else change
    sent = stamps if command_stamps is None else command_stamps
    state = engine.initial_state(np.array([start[0]]), np.array([start[1]]), theta)
    return engine.slopes(theta, change, sent, command, stamps, state)


def differences(model, command, stamps=TIME, command_stamps=None, start=(0.3, 0.8), size=1e-5):
    engine, theta = Engine(model), model.theta
    sent = stamps if command_stamps is None else command_stamps
    point = np.concatenate([theta, start])

    def run(at):
        state = engine.initial_state(at[-2:-1], at[-1:], at[:-2])
        return engine.simulate(at[:-2], sent, command, stamps, initial_state=state)

    columns = []
    for i, value in enumerate(point):
        step = size * max(abs(value), 0.1)
        ahead, behind = point.copy(), point.copy()
        ahead[i], behind[i] = value + step, value - step
        columns.append((run(ahead) - run(behind)) / (2.0 * step))
    return np.array(columns)


def apart(exact, other):
    """Largest distance of a slope from the other in parts of that one's size."""
    return max(np.linalg.norm(a - b) / max(np.linalg.norm(b), 1e-12) for a, b in zip(exact, other, strict=True))


@pytest.mark.parametrize("effect", EFFECTS)
def test_slopes_with_one_effect(effect):
    model = load_model("dc_motor").with_effects([effect])
    for seed in range(3):
        command = smooth_command(seed)
        assert apart(of(model, command), differences(model, command)) < 0.01


@settings(max_examples=30, deadline=None)
@given(
    effects=st.lists(st.sampled_from(EFFECTS), max_size=3, unique_by=lambda t: t.split("_")[-1]),
    seed=st.integers(0, 99),
)
def test_slopes_with_several_effects(effects, seed):
    model, command = load_model("dc_motor").with_effects(effects), smooth_command(seed)
    assert apart(of(model, command), differences(model, command)) < 0.03


def test_commands_between_samples_and_a_known_delay():
    model = load_model("dc_motor").with_effects(["coulomb_friction@motor(level=0.6)"])
    model = model.with_entry("input_delay", "input", {"delay": 0.0107})
    rough = np.sort(np.random.default_rng(3).uniform(0.0, 3.0, 700))
    sent = np.arange(0.0004, 3.0, 0.004)
    command = smooth_command(5, sent)
    given = {"stamps": rough, "command_stamps": sent}
    assert apart(of(model, command, **given), differences(model, command, **given)) < 0.01


def test_a_delay_that_is_estimated_has_no_slope_and_the_others_have():
    model = load_model("dc_motor").with_effects(["input_delay@input(delay=0.0107)"])
    found = of(model, smooth_command(1))
    delay = model.free.index("input_delay@input.delay")
    assert np.all(np.isnan(found[delay]))
    assert np.all(np.isfinite(np.delete(found, delay, axis=0)))


@pytest.mark.parametrize(
    "effect",
    [
        "actuator_lag@input(time_constant=0.05)",
        "presliding_friction@motor(level=0.5, stiffness=300.0, static=0.6, velocity=0.3, damping=0.1)",
        "sensor_delay@position[motor](delay=0.01)",
        "sensor_quantisation@position[motor](resolution=0.01)",
        "compliance@motor(stiffness=200.0, damping=0.5, split=0.4)",
    ],
)
def test_what_remembers_or_reads_otherwise_has_none(effect):
    model = load_model("dc_motor").with_effects([effect])
    assert of(model, smooth_command(0)) is None


def test_several_bodies_have_none():
    model = load_model("torsion")
    engine = Engine(model)
    state = engine.initial_state(None, None, model.theta)
    assert engine.slopes(model.theta, 1e-6 * model.theta, TIME, smooth_command(0), TIME, state) is None


def test_steps_that_are_long_for_the_motion_have_none():
    model = load_model("dc_motor").with_values({"motor.viscous_friction": 300.0})
    assert of(model, smooth_command(0)) is None


def test_a_body_at_rest_stays_and_knows_nothing():
    model = load_model("dc_motor").with_effects(["coulomb_friction@motor(level=20.0)"])
    found = of(model, smooth_command(0), start=(0.3, 0.0))
    np.testing.assert_array_equal(found[:-2], 0.0)
    np.testing.assert_array_equal(found[-2, :, 0], 1.0)
    np.testing.assert_array_equal(found[-1, 1:], 0.0)
