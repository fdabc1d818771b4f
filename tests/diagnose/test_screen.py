"""What the screening remembers of a trace."""

import numpy as np
import pytest

from idloop.diagnose.proposals import proposals
from idloop.diagnose.refit import refit
from idloop.diagnose.screen import Screen
from idloop.diagnose.setting import prepare_setting
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
    setting = prepare_setting(model, [record], "prediction")
    return Screen(setting, refit(setting, model), seed=0)


@pytest.mark.parametrize("name", ["coulomb_friction", "dead_zone", "quadratic_drag", "input_delay", "gain_asymmetry"])
def test_a_sketched_direction_points_to_where_the_effect_moves_the_errors(screen: Screen, name: str) -> None:
    # The null distribution of an effect that can only grow counts one half of the draws: the same for all its shapes.
    (proposal,) = proposals(screen.parent.model, [name])
    traces = [trace for trace in screen(proposal).traces if trace.sketch.shape[1] == 1]
    assert traces
    for trace in traces:
        moved = screen.moved(proposal, trace.trials[0])
        assert moved is not None
        sketched = np.add.reduceat(moved * screen._signs, screen._edges)
        assert float(sketched @ trace.sketch[:, 0]) > 0.0
