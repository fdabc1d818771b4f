"""Coefficients that are not constant: reported as such, and no effect that is confounded with them."""

from dataclasses import replace

import numpy as np
import pytest
from changing_machines import CHANGING, FRICTION, INERTIA, changing, recorded, uneven_inertia

from idloop.diagnosis import diagnose, refine
from idloop.diagnosis.evidence.predicted_motion import predicted_motion
from idloop.diagnosis.residual_curves.prediction_curves import fitted_curves
from idloop.diagnosis.residual_curves.trial_curves import coefficient_trials
from idloop.diagnosis.screening.score_test import Screen
from idloop.estimation.likelihood.estimation_problem import prepare_estimation
from idloop.estimation.likelihood.refit import refit
from idloop.physics import Model, load_model

from .conftest import RATE, record_of


@pytest.mark.slow
@pytest.mark.parametrize("seed", [3, 4])
def test_no_cogging_is_named_where_the_inertia_changes_over_the_turn(start: Model, seed: int) -> None:
    found = diagnose(start, [recorded(changing("inertia over the turn", 0.25), seed)])
    assert found.verdict == "unknown_structure"
    assert found.unknown is not None
    assert found.unknown.of == "inertia"
    assert all("confounded" in why for why in found.passed_over.values())


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
def test_no_wave_is_named_where_an_end_stop_is_met(seed: int) -> None:
    def stopped(_: float, torque: float, position: float, velocity: float) -> float:
        return (torque - 0.3 * position - FRICTION * velocity - 2.0 * max(position - 1.0, 0.0)) / INERTIA

    start = load_model("axis").with_effects(["cable_spring@axis(stiffness=0.3)"])
    found = diagnose(start, [recorded(stopped, seed)])
    assert found.verdict == "unknown_structure"
    assert found.unknown is not None
    assert (found.unknown.of, found.unknown.variable) == ("force", "axis.position")
    assert any("confounded" in why for why in found.passed_over.values())


@pytest.mark.parametrize("gain", [1.0, 300.0])
def test_a_changing_inertia_gives_a_residual_curve(start: Model, gain: float) -> None:
    part = 0.15
    record = recorded(changing("inertia over the turn", part), 3)
    # Cogging is confounded with it whatever the unit of the command.
    record = replace(record, input=record.input / gain)
    found = diagnose(start.with_values({"drive.gain": gain}), [record])
    assert found.verdict == "unknown_structure"
    assert found.unknown is not None
    assert (found.unknown.of, found.unknown.variable) == ("inertia", "axis.position within a turn")
    assert "the inertia changes with the position" in found.unknown.text
    truth = part * INERTIA * np.cos(2.0 * found.unknown.at)
    assert np.corrcoef(truth, found.unknown.force)[0, 1] > 0.95
    assert np.ptp(found.unknown.force) == pytest.approx(2.0 * part * INERTIA, rel=0.25)
    assert found.unknown.force_unit == "kg·m²"


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["friction over time", "drive over the turn"])
def test_other_changing_coefficients_give_residual_curves(start: Model, kind: str) -> None:
    found = diagnose(start, [recorded(changing(kind, 0.4), 3, seconds=30.0)])
    assert found.best is None
    assert found.unknown is not None
    assert (found.unknown.of, found.unknown.variable) == CHANGING[kind][1:]


def swept(time: np.ndarray) -> np.ndarray:
    """From 0.3 to 20 Hz."""
    return 0.5 * np.sin(2.0 * np.pi * 0.3 * time[-1] / np.log(66.0) * (66.0 ** (time / time[-1]) - 1.0))


@pytest.mark.parametrize("sweep", [False, True])
def test_in_a_sweep_time_and_frequency_are_confounded(start: Model, sweep: bool) -> None:
    time = np.arange(0.0, 20.0, 1.0 / RATE)
    record = record_of(load_model("axis"), 5, seconds=20.0, command=swept(time) if sweep else None)
    estimation = prepare_estimation(start, [record], "prediction")
    shapes = coefficient_trials(Screen(estimation, refit(estimation, start), 0))
    assert shapes
    assert any(shape.over == "time" for shape in shapes) is not sweep


@pytest.mark.slow
@pytest.mark.parametrize("sweep", [False, True])
def test_a_spring_whose_drag_is_on_one_side_is_named(start: Model, sweep: bool) -> None:
    time = np.arange(0.0, 20.0, 1.0 / RATE)
    machine = load_model("axis").with_effects(
        ["compliance@axis(stiffness=12.0, damping=0.02, split=0.5, viscous_split=0.0)"]
    )
    record = record_of(machine, 5, seconds=20.0, command=swept(time) if sweep else None)
    found = diagnose(start, [record])
    assert found.set == ("compliance@axis",)
    assert found.best is not None
    for name, truth in {"stiffness": 12.0, "split": 0.5}.items():
        assert found.best.parameters[name]["value"] == pytest.approx(truth, rel=0.02)
    assert found.best.parameters["viscous_split"]["value"] < 0.1


@pytest.mark.slow
def test_an_effect_beside_a_changing_coefficient_is_added_and_the_curve_reported(start: Model) -> None:
    def both(t: float, torque: float, position: float, velocity: float) -> float:
        return uneven_inertia(t, torque - 0.15 * np.tanh(velocity / 1e-2), position, velocity, 0.25)

    ladder = refine(start, [recorded(both, 4)])
    assert ladder.added == ("coulomb_friction@axis",)
    assert ladder.verdict == "unknown_structure"
    assert ladder.unknown is not None
    assert ladder.unknown.of == "inertia"


@pytest.mark.slow
def test_nothing_is_left_of_a_machine_that_the_model_describes() -> None:
    model = load_model("axis")
    for seed in range(8):
        estimation = prepare_estimation(model, [record_of(model, seed, disturbance=0.05)], "prediction")
        assert not fitted_curves(Screen(estimation, refit(estimation, model), seed), 0.01)


@pytest.mark.parametrize("kind", ["prediction", "simulation"])
def test_the_predicted_motion_is_that_of_the_machine(kind: str) -> None:
    model = load_model("axis")
    record = record_of(model, 2)
    estimation = prepare_estimation(model, [record], kind)
    motions = predicted_motion(refit(estimation, model))
    assert motions is not None
    (motion,) = motions
    settled = slice(200, None)
    assert np.corrcoef(motion.position[settled], record.output[settled, 0])[0, 1] > 0.999
    assert np.corrcoef(motion.velocity[settled], record.output[settled, 1])[0, 1] > 0.99
    turned = np.gradient(motion.velocity, motion.time)[settled]
    assert np.corrcoef(motion.acceleration[settled], turned)[0, 1] > 0.8
    assert motion.drive == pytest.approx(record.input)
