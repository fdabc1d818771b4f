"""Traces of the score test."""

import numpy as np
import pytest
from tests.diagnosis.conftest import record_of

from idloop.diagnosis.evidence.prediction_view import PredictionView
from idloop.diagnosis.options import Options
from idloop.diagnosis.screening.proposals import proposals
from idloop.diagnosis.screening.score_test import Screen
from idloop.estimation.likelihood.estimation_problem import prepare_estimation
from idloop.estimation.likelihood.refit import refit
from idloop.physics import load_model
from idloop.physics.simulation import simulate
from idloop.records import Record


@pytest.fixture(scope="module")
def screen() -> Screen:
    """The errors of a plain axis under random steps."""
    model, rng = load_model("axis"), np.random.default_rng(0)
    time = np.arange(0.0, 3.0, 0.005)
    command = rng.normal(size=13)[(4.0 * time).astype(int)]
    noise = np.column_stack([rng.normal(size=len(time)) * float(o.noise or 0.0) for o in model.outputs])
    output = simulate(model, time, command, time, noise=noise).output
    names, units = tuple(o.name for o in model.outputs), tuple(o.unit for o in model.outputs)
    record = Record("run", time, command, time, output, "axis.effort", model.input.unit, names, units)
    estimation = prepare_estimation(model, [record], "prediction")
    return Screen(estimation, refit(estimation, model), seed=0)


@pytest.mark.parametrize("name", ["coulomb_friction", "dead_zone", "quadratic_drag", "input_delay", "gain_asymmetry"])
def test_a_sketched_direction_points_to_where_the_effect_moves_the_errors(screen: Screen, name: str) -> None:
    # The null distribution of an effect that can only grow counts one half of the draws: the same for all its shapes.
    (proposal,) = proposals(screen.parent.model, [name])
    traces = [trace for trace in screen(proposal).traces if trace.sketch.shape[1] == 1]
    assert traces
    for trace in traces:
        moved = screen.response_to_effect(proposal, trace.trials[0])
        assert moved is not None
        sketched = np.add.reduceat(moved * screen._signs, screen._edges)
        assert float(sketched @ trace.sketch[:, 0]) > 0.0


@pytest.mark.parametrize("size", [1.0, -4.0])
def test_a_trace_counts_by_what_is_its_own_however_much_the_parameters_could_do(screen: Screen, size: float) -> None:
    # A two-level command behind a dead zone: nearly another gain, and yet far above the noise.
    own = np.random.default_rng(1).normal(size=len(screen.errors))
    own -= screen.basis @ (screen.basis.T @ own)
    own /= np.linalg.norm(own)
    moved = 1e4 * screen.basis[:, 0] + 5.0 * own
    without = screen.errors - own * (own @ screen.errors)
    screen_errors, screen.errors = screen.errors, without - 5.0 * size * own
    try:
        trace = screen._measure([{}], [moved], [False])
    finally:
        screen.errors = screen_errors
    assert trace is not None
    assert trace.own_part < 1e-6
    assert trace.detectable == pytest.approx(25.0, rel=1e-3)
    assert trace.size[0] == pytest.approx(size, rel=1e-3)
    assert trace.statistic == pytest.approx(25.0 * size**2, rel=1e-3)


@pytest.mark.parametrize("seed", range(3))
def test_where_nothing_disturbs_the_disturbances_strength_takes_no_direction(seed: int) -> None:
    # Its slope there is that of a bound, along which the errors lie: what was projected on it looked like effects.
    model = load_model("axis").with_effects(["dead_zone@input(width=0.1)"])
    estimation = prepare_estimation(model, [record_of(model, seed, seconds=8.0)], "prediction")
    parent = refit(estimation, model)
    screen = Screen(estimation, parent, 0)
    disturbed = parent.criterion.exponent > -5.0
    assert screen.basis.shape[1] <= parent.parameters + 2 * disturbed
    if not disturbed:
        assert screen.basis.shape[1] == parent.parameters


@pytest.mark.parametrize(("effect", "several"), [("sensor_ripple@position[axis]", True), ("coulomb_friction", False)])
def test_every_whole_number_that_was_tried_counts_as_a_choice(screen: Screen, effect: str, several: bool) -> None:
    """The best of twelve harmonics shows by chance more often than one effect does."""
    (proposal,) = proposals(screen.parent.model, [effect])
    scales = screen.sizes.at(proposal.effect.site, proposal.at)
    tried = {trials[0].get("harmonic") for trials in proposal.alternatives(scales)}
    assert (len(tried) > 1) is several
    assert screen(proposal).choices == len(tried)
    view = PredictionView(screen.estimation, screen.parent.model, Options(effects=[effect]))
    assert view.evaluate(screen.parent).threshold() == pytest.approx(np.log(len(tried) / 0.01))
