"""Prediction, force balance and linear part of a model."""

import pickle

import numpy as np
import pytest
from scipy.linalg import expm

from idloop.physics import Engine, Plant, load_model, simulate

TIME = np.arange(0.0, 2.0, 0.002)
COMMAND = np.sign(np.sin(9.0 * TIME)) + 0.3 * np.sin(31.0 * TIME)


def test_without_gain_the_predictor_is_the_free_run() -> None:
    model = load_model("torsion").with_effect("coulomb_friction", "motor", level=0.01)
    engine = Engine(model)
    measured = np.zeros((len(TIME), 4))
    innovation = engine.predict(None, TIME, COMMAND, TIME, measured, np.zeros((9, 4)))
    np.testing.assert_array_equal(-innovation, engine.simulate(None, TIME, COMMAND, TIME))


def test_a_measurement_that_is_missing_corrects_nothing() -> None:
    engine = Engine(load_model("dc_motor"))
    measured = np.full((len(TIME), 2), np.nan)
    measured[:, 0] = 0.5
    both = np.array([[0.5, 0.3], [0.1, 0.3], [0.0, 0.2]])
    one = both.copy()
    one[:, 1] = 0.0
    seen = engine.predict(None, TIME, COMMAND, TIME, measured, both)
    np.testing.assert_array_equal(seen[:, 0], engine.predict(None, TIME, COMMAND, TIME, measured, one)[:, 0])
    assert np.all(np.isnan(seen[:, 1]))


def test_gain_pulls_the_prediction_to_the_machine() -> None:
    truth = load_model("dc_motor").with_effect("load_torque", "motor", torque=0.5)
    measured = simulate(truth, TIME, COMMAND, TIME).output
    engine = Engine(load_model("dc_motor"))
    gain = np.array([[0.3, 0.0], [0.0, 0.3], [0.0, 20.0]])
    free = engine.simulate(None, TIME, COMMAND, TIME) - measured
    corrected = engine.predict(None, TIME, COMMAND, TIME, measured, gain)
    assert np.abs(corrected[-100:]).max() < 1e-4 * np.abs(free[-100:]).max()


def test_a_predictor_that_runs_away_stops_there() -> None:
    engine = Engine(load_model("torsion"))
    measured = engine.simulate(None, TIME, COMMAND, TIME) + 1e-3
    wrong = np.zeros((9, 4))
    wrong[4, 0] = -1e4  # pushes the driven body away from what is measured
    innovation = engine.predict(None, TIME, COMMAND, TIME, measured, wrong)
    gone = ~np.isfinite(innovation[:, 0])
    assert not gone[0]
    assert np.all(innovation[np.argmax(gone) :] == np.inf)
    assert np.nanmax(np.abs(innovation[~gone])) < 1e12


def test_the_force_balance_closes_on_the_models_own_motion() -> None:
    model = load_model("axis").with_effect("imbalance", "axis", amplitude=0.05, phase=0.2)
    model = model.with_effect("stribeck_friction", "axis", coulomb=0.05, static=0.08, velocity=0.5)
    model = model.with_effect("actuator_lag", "input", time_constant=0.03)
    fine = np.arange(0.0, 2.0, 1e-4)
    command = np.sign(np.sin(9.0 * fine))
    x, v = simulate(model, fine, command, fine).output.T
    a = np.gradient(v, fine)
    motion = x[:, None], v[:, None], a[:, None]
    left = Engine(model).balance(None, *motion, fine, command, fine, rest_speed=1e-6).residual[:, 0]
    away = np.abs(v) > 0.05
    assert np.percentile(np.abs(left[away]), 99) < 2e-3
    without = Engine(model.without_effect("imbalance@axis"))
    wrong = without.balance(None, *motion, fine, command, fine, rest_speed=1e-6).residual[:, 0]
    np.testing.assert_allclose((wrong - left)[away], -0.05 * np.sin(x[away] + 0.2), atol=1e-12)


def test_applied_and_required_force_differ_by_the_residual() -> None:
    model = load_model("emps")
    t = np.arange(0.0, 1.0, 0.001)
    motion = np.sin(t)[:, None], np.cos(t)[:, None], -np.sin(t)[:, None]
    found = Engine(model).balance(None, *motion, t, np.sin(t), t)
    np.testing.assert_allclose(found.applied, 35.15065 * np.sin(t), atol=1e-9)
    np.testing.assert_allclose(found.required, 100.0 * -np.sin(t) + 100.0 * np.cos(t), atol=1e-9)


def test_the_linear_part_predicts_small_motion() -> None:
    model = load_model("torsion").with_effect("cable_spring", "load3", stiffness=0.4)
    linear = Engine(model).linearise()
    big = np.zeros((9, 9))
    big[:8, :8], big[:8, 8] = linear.A, linear.B
    step = expm(big * 0.002)
    x, expected = np.zeros(9), []
    for u in COMMAND:
        x[8] = u
        expected.append(linear.C @ x[:8])
        x = step @ x
    np.testing.assert_allclose(simulate(model, TIME, COMMAND, TIME).output, expected, atol=2e-4)


def test_a_plant_stepped_is_the_same_as_a_simulation() -> None:
    model = load_model("torsion").with_effects(
        [
            "coulomb_friction@motor(level=0.02)",
            "input_delay@input(delay=0.0031)",
            "sensor_delay@position[load3](delay=0.0123)",
        ]
    )
    plant = Plant(model, noise=False)
    seen = []
    for k, u in enumerate(COMMAND):
        seen.append(plant.measure())
        plant.step(u, TIME[k] + 0.002)
    np.testing.assert_allclose(seen, simulate(model, TIME, COMMAND, TIME).output, atol=1e-9)


def test_plants_of_one_seed_are_equal_and_of_two_are_not() -> None:
    def run(seed: int) -> np.ndarray:
        plant = Plant(load_model("dc_motor"), seed, disturbance_std=0.3)
        out = []
        for k in range(300):
            out.append(plant.measure())
            plant.step(1.0, 0.01 * (k + 1))
        return np.array(out)

    np.testing.assert_array_equal(run(4), run(4))
    assert np.any(run(4) != run(5))


def test_a_plant_runs_on_when_its_memory_of_commands_is_full() -> None:
    plant = Plant(load_model("dc_motor"), noise=False)
    for k in range(9000):
        plant.step(1.0, 0.001 * (k + 1))
    expected = simulate(load_model("dc_motor"), [0.0], [1.0], [0.0, 9.0]).output[-1]
    np.testing.assert_allclose(plant.measure(), expected, rtol=1e-9)


def test_uneven_stamps_give_the_same_motion() -> None:
    model = load_model("dc_motor")
    keep = np.sort(np.random.default_rng(1).choice(len(TIME), 200, replace=False))
    keep[0] = 0
    full = simulate(model, TIME, COMMAND, TIME).output
    np.testing.assert_allclose(simulate(model, TIME, COMMAND, TIME[keep]).output, full[keep], atol=1e-9)


def test_a_model_travels_to_another_process() -> None:
    model = load_model("dc_motor").with_effect("dead_zone", "input", width=0.12)
    back = pickle.loads(pickle.dumps(model))
    assert back.values == model.values
    assert back.free == model.free
    assert back.effect_names == ("dead_zone@input",)


@pytest.mark.parametrize("name", ["dc_motor", "torsion", "lead_screw", "axis", "emps"])
def test_every_preset_runs(name: str) -> None:
    run = simulate(load_model(name), TIME, COMMAND, TIME)
    assert np.all(np.isfinite(run.output))
    assert np.ptp(run.output) > 0.0


def test_a_motion_that_runs_away_ends_and_is_no_number() -> None:
    # negative friction: the speed grows without bound, and with it the step that an imbalance would ask for
    model = load_model("axis").with_effect("imbalance", "axis", amplitude=0.1)
    engine = Engine(model)
    theta = np.array([1e-4, -50.0, 0.1, 0.0])
    output = engine.simulate(theta, np.array([0.0]), np.array([1.0]), TIME)
    assert not np.all(np.isfinite(output))


def test_absurd_stiffness_costs_bounded_time() -> None:
    model = load_model("axis").with_effect("imbalance", "axis", amplitude=1e12)
    output = Engine(model).simulate(None, np.array([0.0]), np.array([1.0]), TIME[:100])
    assert output.shape == (100, 2)


def test_a_plant_that_has_fallen_behind_keeps_every_command_that_is_still_to_come():
    behind, abreast = (Plant(load_model("dc_motor"), noise=False) for _ in range(2))
    commands = np.sin(0.01 * np.arange(10_000))
    for k, command in enumerate(commands):
        behind.schedule(1e-3 * k, command)
    for k, command in enumerate(commands):
        abreast.schedule(1e-3 * k, command)
        abreast.advance(1e-3 * (k + 1))
    behind.advance(10.0)
    assert np.allclose(behind.measure(), abreast.measure(), rtol=1e-9)


@pytest.mark.parametrize(
    "effect",
    [
        "stribeck_friction@axis(coulomb=0.2,static=0.3,velocity=0.1)",
        "presliding_friction@axis(level=0.2,stiffness=50,static=0.3,velocity=0.1,damping=0.1)",
    ],
)
def test_a_search_finds_no_motion_where_static_friction_is_below_the_kinetic_one(effect: str) -> None:
    model = load_model("axis").with_effects([effect])
    engine, place = Engine(model), [name.rpartition(".")[2] for name in model.free].index("static")
    measured, motion = np.zeros((len(TIME), 2)), np.zeros((len(TIME), 1))
    for static, moves in ((0.3, True), (0.2, True), (0.1, False)):
        theta = model.theta
        theta[place] = static
        assert np.all(np.isfinite(engine.simulate(theta, TIME, COMMAND, TIME))) == moves
        predicted = engine.predict(theta, TIME, COMMAND, TIME, measured, np.zeros((3, 2)))
        assert np.all(np.isfinite(predicted)) == moves
        left = engine.balance(theta, motion, motion, motion, TIME, COMMAND, TIME).residual
        assert np.all(np.isfinite(left)) == moves
