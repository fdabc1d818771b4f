"""Fits with unknown intensity and memory of the disturbance."""

from dataclasses import replace

import numpy as np
import pytest

from idloop.estimation.likelihood.disturbance import LONG_MEMORY
from idloop.estimation.likelihood.estimation_problem import EstimationProblem, prepare_estimation
from idloop.estimation.likelihood.refit import Refit, _other_disturbance, refit, transfer
from idloop.estimation.observer.innovations import WALK, WHITE
from idloop.physics import Model, load_model
from idloop.physics.simulation import simulate
from idloop.records import Record

STEP = 0.01
# Decades of a sample: less than ten samples.
SHORT_MEMORY = 1.0


def disturbed(machine: Model, force: np.ndarray, seed: int) -> Record:
    """Open-loop record of a machine under random steps, pushed by a force that is held from sample to sample."""
    rng = np.random.default_rng(seed)
    time = STEP * np.arange(len(force))
    command = rng.normal(size=len(force) // 25 + 1).repeat(25)[: len(force)]
    noise = rng.normal(size=(len(force), 2)) * [o.noise for o in machine.outputs]
    output = simulate(machine, time, command + force, time, noise=noise).output
    names, units = tuple(o.name for o in machine.outputs), tuple(o.unit for o in machine.outputs)
    return Record("run", time, command, time, output, "axis.effort", machine.input.unit, names, units)


@pytest.fixture(scope="module")
def start() -> Model:
    """The plain axis, a third off."""
    model = load_model("axis")
    return model.with_values({p.name: 0.7 * p.value for p in model.parameters if p.free})


def under_both(start: Model, seed: int) -> dict[str, EstimationProblem]:
    """The same run under two disturbances: forgotten at once, and never."""
    shocks = np.random.default_rng(seed).normal(size=600)
    forces = {"white": 0.05 * shocks, "walk": 0.01 * np.cumsum(shocks)}
    return {
        name: prepare_estimation(start, [disturbed(load_model("axis"), force, seed + 50)], "prediction")
        for name, force in forces.items()
    }


@pytest.fixture(scope="module")
def problems(start: Model) -> dict[str, EstimationProblem]:
    return under_both(start, 4)


@pytest.fixture(scope="module")
def found(start: Model, problems: dict[str, EstimationProblem]) -> dict[str, Refit]:
    return {name: refit(estimation, start) for name, estimation in problems.items()}


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_white_disturbance_ends_with_a_short_memory_and_a_walk_with_a_long_one(start: Model, seed: int) -> None:
    fits = {name: refit(estimation, start) for name, estimation in under_both(start, seed).items()}
    assert fits["white"].criterion.memory < SHORT_MEMORY
    assert fits["walk"].criterion.memory >= LONG_MEMORY
    for fit in fits.values():
        assert fit.model.values["axis.inertia"] == pytest.approx(0.01, rel=0.02)


def test_the_model_file_gets_only_a_random_walk(found: dict[str, Refit]) -> None:
    assert found["white"].model.disturbance is None
    assert found["walk"].model.disturbance == pytest.approx(0.01 / np.sqrt(STEP), rel=0.5)


@pytest.mark.parametrize(("name", "exponent", "memory"), [("white", -8.0, WALK), ("walk", 2.0, WHITE)])
def test_a_neighbour_with_another_disturbance_does_not_change_the_result(
    name: str,
    exponent: float,
    memory: float,
    start: Model,
    problems: dict[str, EstimationProblem],
    found: dict[str, Refit],
) -> None:
    fit = found[name]
    neighbour = replace(fit, point=np.array([*fit.point[: fit.parameters], exponent, memory]))
    again = refit(problems[name], start, None, neighbour)
    assert again.log_likelihood == pytest.approx(fit.log_likelihood, abs=5.0)
    assert (again.criterion.memory >= LONG_MEMORY) == (name == "walk")


@pytest.mark.parametrize("name", ["white", "walk"])
def test_no_other_disturbance_explains_the_record_better(
    name: str, problems: dict[str, EstimationProblem], found: dict[str, Refit]
) -> None:
    fit = found[name]
    theta, values = fit.point[: fit.parameters], []
    for exponent in np.arange(-8.0, 3.0, 1.0):
        for memory in (-1.0, 0.0, 1.0, 2.0, 3.0, 5.0):
            other = transfer(problems[name], replace(fit, point=np.array([*theta, exponent, memory])))
            assert other is not None
            values.append(other.log_likelihood)
    assert max(values) < fit.log_likelihood + 0.5
    # It matters which one.
    assert np.median(values) < fit.log_likelihood - 10.0


@pytest.mark.parametrize(("name", "exponent", "memory"), [("white", -4.0, WALK), ("walk", 0.0, WHITE)])
def test_a_search_leaves_a_local_optimum_of_the_disturbance(
    name: str, exponent: float, memory: float, problems: dict[str, EstimationProblem], found: dict[str, Refit]
) -> None:
    fit = found[name]
    stuck = replace(fit, point=np.array([*fit.point[: fit.parameters], exponent, memory]))
    other = _other_disturbance(problems[name], stuck)
    assert other is not None
    assert (other.nuisance[1] >= LONG_MEMORY) == (name == "walk")
    # And what is the best already is left alone.
    assert _other_disturbance(problems[name], fit) is None


def test_an_effect_without_influence_at_the_start_is_fitted(start: Model) -> None:
    machine = load_model("axis").with_effect("saturation", "input", limit=1.0)
    guess = start.with_effect("saturation", "input", limit=4.5)
    estimation = prepare_estimation(guess, [disturbed(machine, np.zeros(1200), 3)], "prediction")
    assert refit(estimation, guess).model.values["saturation@input.limit"] == pytest.approx(1.0, abs=0.01)


def test_several_harmonics_are_fitted_from_the_model_without_effects(start: Model) -> None:
    waves = [(0.2, 3, 0.4), (0.1, 7, -1.0), (0.05, 11, 2.0)]
    hidden, near = load_model("axis"), start
    for amplitude, harmonic, phase in waves:
        hidden = hidden.with_effect("cogging", "axis", amplitude=amplitude, harmonic=harmonic, phase=phase)
        near = near.with_effect("cogging", "axis", amplitude=1.3 * amplitude, harmonic=harmonic, phase=phase)
    record = disturbed(hidden, np.zeros(1000), 0)
    fit = refit(prepare_estimation(near, [record], "prediction"), near)
    for (amplitude, _, _), name in zip(waves, fit.model.effect_names, strict=True):
        assert abs(fit.model.values[f"{name}.amplitude"]) == pytest.approx(amplitude, rel=0.05)
