"""An experiment: simulated as the machine would run it, in open and in closed loop."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from idloop.control import build_controller
from idloop.diagnosis.design.experiment import Experiment
from idloop.errors import InputError
from idloop.physics import Plant, load_model, simulate
from idloop.signals import build_signal

STEPS = {"name": "multilevel", "sample_time": 0.01, "duration": 3.0, "amplitude": 2.0, "seed": 4}
MOVES = {"name": "multilevel", "sample_time": 0.001, "duration": 1.0, "amplitude": 0.3, "seed": 4}


def test_in_open_loop_it_is_the_free_run():
    model = load_model("dc_motor").with_effects(["dead_zone@input(width=0.3)"])
    record = Experiment(STEPS, start=0.7).run(model)
    signal = build_signal(**STEPS)
    np.testing.assert_array_equal(record.input, signal.value)
    expected = simulate(model, signal.time, signal.value, record.time, position=[0.7])
    np.testing.assert_array_equal(record.output, expected.output)
    assert record.duration == pytest.approx(3.0)
    assert record.output_names == model.output_names
    assert record.reference is None
    np.testing.assert_array_equal(record.excitation[:, 1], signal.value)


@pytest.mark.parametrize("preset", ("torsion", "axis"))
def test_in_closed_loop_it_is_what_plant_and_controller_do_step_by_step(preset):
    model = load_model(preset).with_effects([f"coulomb_friction@{load_model(preset).bodies[0]}(level=0.002)"])
    record = Experiment(MOVES, "reference", model.controller).run(model)
    value = build_signal(**MOVES).value
    plant, controller = Plant(model, noise=False), build_controller(model.controller)
    for k in range(700):
        measured = plant.measure()
        np.testing.assert_allclose(record.output[k], measured, atol=1e-9)
        command = controller.step(value[k], 0.0, dict(zip(model.output_names, measured, strict=True)))
        assert record.input[k] == pytest.approx(command, abs=1e-6)
        plant.step(command, (k + 1) * 1e-3)
    np.testing.assert_array_equal(record.reference[:, 0], value)


def test_a_slower_sensor_is_read_at_its_own_instants_and_held_by_nobody():
    model = load_model("axis")
    fast = Experiment(MOVES, "reference", model.controller).run(model)
    slow = Experiment(MOVES, "reference", model.controller, sample_time=0.004).run(model)
    np.testing.assert_allclose(slow.time, fast.time[::4], atol=1e-12)
    np.testing.assert_allclose(slow.output, fast.output[::4], atol=1e-9)
    np.testing.assert_allclose(slow.input, fast.input, atol=1e-9)


def test_the_reference_is_held_at_the_start():
    model = load_model("axis")
    still = {**MOVES, "amplitude": 0.0}
    record = Experiment(still, "reference", model.controller, start=1.5).run(model)
    np.testing.assert_allclose(record.output[:, 0], 1.5, atol=1e-12)
    np.testing.assert_allclose(record.input, 0.0, atol=1e-12)


def test_the_command_may_be_excited_inside_the_loop():
    model = load_model("axis")
    closed = Experiment({**MOVES, "amplitude": 0.5}, "command", model.controller).run(model)
    opened = Experiment({**MOVES, "amplitude": 0.5}).run(model)
    assert np.ptp(closed.output[:, 0]) < 0.8 * np.ptp(opened.output[:, 0])
    assert np.any(closed.input != closed.excitation[0, 1])


def test_noise_and_disturbance_are_those_asked_for_and_repeat_with_the_seed():
    model = load_model("dc_motor")
    experiment = Experiment({**STEPS, "duration": 30.0})
    clean = experiment.run(model)
    noisy = experiment.run(model, noise=True, seed=1)
    spread = np.std(noisy.output - clean.output, axis=0)
    np.testing.assert_allclose(spread, [o.noise for o in model.outputs], rtol=0.1)
    pushed = experiment.run(model, disturbance=0.3, seed=1)
    assert np.max(np.abs(pushed.output - clean.output)) > 0.05
    again = experiment.run(model, disturbance=0.3, seed=1)
    np.testing.assert_array_equal(pushed.output, again.output)
    assert np.any(experiment.run(model, disturbance=0.3, seed=2).output != pushed.output)


def test_other_values_of_the_free_parameters_are_simulated():
    model = load_model("dc_motor")
    experiment = Experiment(STEPS)
    moved = model.with_theta(1.1 * model.theta)
    np.testing.assert_array_equal(experiment.run(model, theta=1.1 * model.theta).output, experiment.run(moved).output)


@pytest.mark.parametrize(
    ("arguments", "word"),
    (
        ((STEPS, "torque"), "torque"),
        ((STEPS, "reference"), "controller"),
        (({**STEPS, "hold_max": 0.01},), "hold_max"),
    ),
)
def test_contradicting_parts_are_refused(arguments, word):
    with pytest.raises(InputError, match=word):
        Experiment(*arguments).run(load_model("dc_motor"))


def test_a_controller_of_an_unmeasured_output_is_refused():
    model = load_model("axis")
    blind = replace(model, outputs=model.outputs[1:])
    with pytest.raises(InputError, match=r"axis\.position"):
        Experiment(MOVES, "reference", model.controller).run(blind)
