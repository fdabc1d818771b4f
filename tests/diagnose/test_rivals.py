"""What the data cannot tell from the best effect comes with it, and what explains more takes its place."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from idloop.diagnose import diagnose
from idloop.diagnose.confirm import Confirmed
from idloop.diagnose.predictive import Evidence, Scores
from idloop.diagnose.proposals import Proposal, proposals
from idloop.diagnose.refit import Refit, refit, transfer
from idloop.diagnose.rivals import from_the_best
from idloop.diagnose.screen import SKETCH, Screened, Trace
from idloop.diagnose.setting import Setting, prepare_setting
from idloop.diagnose.step import Weighed
from idloop.estimate.innovations import WALK
from idloop.physics import Model, load_model
from idloop.physics.effect import built_in

from .conftest import RATE, record_of

SECONDS = 10.0


def two_levels(rng: np.random.Generator) -> NDArray[np.float64]:
    """A command of one size, to either side."""
    return np.where(rng.normal(size=int(4 * SECONDS)) > 0.0, 1.0, -1.0).repeat(int(RATE / 4))


def one_way(rng: np.random.Generator) -> NDArray[np.float64]:
    """A command that keeps the axis turning one way."""
    return (1.0 + 0.3 * rng.normal(size=int(4 * SECONDS)).clip(-2.0, 2.0)).repeat(int(RATE / 4))


def contains(found: tuple[str, ...], rich: str) -> bool:
    """Whether a set has an effect that a richer one contains."""
    name, _, at = rich.partition("@")
    (effect,) = built_in()[name]
    return any(f"{plain}@{at}" in found for plain in effect.contains)


@pytest.mark.parametrize(
    ("hidden", "command", "set_"),
    [
        pytest.param(
            "gain_asymmetry@input(ratio=-0.2)",
            two_levels,
            {"input_offset@input", "gain_asymmetry@input"},
            id="two levels show no more of an asymmetric gain than an offset",
        ),
        pytest.param(
            "asymmetric_friction@axis(level=0.3,ratio=0.4)",
            one_way,
            {"asymmetric_friction@axis"},
            id="friction of an axis that never reverses",
        ),
    ],
)
def test_the_truth_is_in_the_set_where_the_data_show_it_poorly(
    start: Model, hidden: str, command: Callable[[np.random.Generator], NDArray[np.float64]], set_: set[str]
) -> None:
    machine = load_model("axis").with_effects([hidden])
    values = command(np.random.default_rng(3))
    found = diagnose(start, [record_of(machine, 3, disturbance=0.05, command=values)])
    # A richer effect that contains a plain one which explains as much waits until what it has beyond that shows.
    assert all(name in found.set or contains(found.set, name) for name in set_)


def leaving_one_trace(proposal: Proposal) -> Screened:
    """An effect that leaves the trace which all leave here."""
    trace = Trace([{}], 0.0, np.zeros(1), 0.0, 1.0, False, sketch=np.eye(SKETCH, 1), scores=np.zeros(1))
    return Screened(proposal, [trace])


def refitted(setting: Setting, parent: Refit, name: str, values: dict[str, float]) -> Confirmed:
    (proposal,) = proposals(parent.model, [name])
    fit = refit(setting, proposal.model(values), None, parent)
    return Confirmed(proposal, fit, 0.0, 100.0).refitted(fit, parent)


def test_what_a_search_has_left_behind_is_searched_from_the_best_ones_optimum(start: Model) -> None:
    machine = load_model("axis").with_effects(["gain_asymmetry@input(ratio=-0.2)"])
    record = record_of(machine, 3, disturbance=0.05, command=two_levels(np.random.default_rng(3)))
    setting = prepare_setting(start, [record], "prediction")
    parent = refit(setting, start)
    best = refitted(setting, parent, "input_offset", {"offset": -0.1})
    twin = refitted(setting, parent, "gain_asymmetry", {"ratio": -0.1})
    lost = transfer(setting, replace(twin.fit, point=np.array([*twin.fit.point[: twin.fit.parameters], -4.0, WALK])))
    assert lost is not None
    assert lost.log_likelihood < best.fit.log_likelihood - 50.0
    behind = replace(twin, fit=lost, gain=0.0)
    screened = [leaving_one_trace(c.proposal) for c in (best, twin)]
    first = Weighed((best.proposal,), best.fit, Scores(np.zeros(1), []), Evidence(0.0, 1.0, 0.0, 1), best.gain)
    (rival,) = from_the_best(setting, parent, first, screened, [best, behind])
    assert rival.proposal.name == twin.proposal.name
    assert rival.fit.log_likelihood == pytest.approx(best.fit.log_likelihood, abs=1.0)
    assert rival.gain == pytest.approx(rival.fit.log_likelihood - parent.log_likelihood, abs=1e-6)
