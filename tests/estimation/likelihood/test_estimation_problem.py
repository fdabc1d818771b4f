"""Parameter values that an estimation admits."""

from dataclasses import replace

import numpy as np
import pytest
from tests.diagnosis.conftest import record_of

from idloop.diagnosis.screening.typical_sizes import Sizes
from idloop.errors import IdloopError
from idloop.estimation.likelihood.estimation_problem import BoundedRateEngine, prepare_estimation
from idloop.estimation.likelihood.refit import refit, transfer
from idloop.physics import load_model

STEP = 0.002


def test_effects_may_be_as_quick_as_the_stiff_chain_that_they_sit_in() -> None:
    # A gap between nut and stage takes shorter steps than the samples, but no shorter ones than the screw's own modes.
    gap = load_model("lead_screw").with_effects(["backlash@nut-stage(gap=0.01)"])
    assert BoundedRateEngine(gap, STEP, speed=10.0).layout(None).axis.coupling_hooks.shape[0] == 1


def test_a_chain_at_its_limit_leaves_room_for_an_effect() -> None:
    plain = load_model("torsion")
    low, high = plain.values["motor-load1.stiffness"], 1e9
    # The stiffest coupling that passes.
    for _ in range(60):
        middle = float(np.sqrt(low * high))
        try:
            BoundedRateEngine(plain.with_values({"motor-load1.stiffness": middle}), STEP, 1.0).layout(None)
            low = middle
        except IdloopError:
            high = middle
    stiff = plain.with_values({"motor-load1.stiffness": low})
    slipping = stiff.with_effects(["slip@load2-load3(limit=0.1)"])
    assert BoundedRateEngine(slipping, STEP, 1.0).layout(None).axis.coupling_hooks.shape[0] == 1
    with pytest.raises(IdloopError, match="faster than the samples"):
        BoundedRateEngine(slipping.with_values({"motor-load1.stiffness": 1.1 * low}), STEP, 1.0).layout(None)


def test_the_speed_of_a_body_is_known_from_its_position_where_its_velocity_is_left_out() -> None:
    model = load_model("axis")
    record = record_of(model, 4, seconds=6.0)
    place = np.round(record.output[:, 0], 4)
    computed = np.column_stack([place, np.gradient(place, record.time)])
    whole, left = (
        Sizes(model, prepare_estimation(model, [one], "simulation")).bodies[0]
        for one in (record, replace(record, output=computed))
    )
    assert left == pytest.approx(whole, rel=0.05)


@pytest.mark.parametrize("inertia", [1e-8, 1e-7])
def test_a_search_begins_where_the_samples_resolve_the_model(inertia: float) -> None:
    model = load_model("axis")
    estimation = prepare_estimation(model, [record_of(model, 4, seconds=6.0)], "prediction")
    start = model.with_values({"axis.inertia": inertia})
    with pytest.raises(IdloopError, match="faster than the samples"):
        estimation.engine(start).layout(None)
    assert estimation.resolves(estimation.resolvable(start))
    assert estimation.resolvable(model) is model
    np.testing.assert_allclose(refit(estimation, start).model.theta, model.theta, rtol=0.1)


def test_what_is_known_is_no_start_that_a_search_may_raise() -> None:
    model = load_model("axis")
    estimation = prepare_estimation(model, [record_of(model, 4, seconds=6.0)], "prediction")
    known = model.with_values({"axis.inertia": 1e-8}).with_free(set(model.free) - {"axis.inertia"})
    assert not estimation.resolves(known)
    assert estimation.resolvable(known) is known


def test_records_have_the_groups_of_their_companions() -> None:
    """One log whose sensors are sampled together, beside others whose velocity comes less often."""
    model = load_model("axis")
    whole, other = (record_of(model, seed, seconds=6.0) for seed in (1, 2))
    sparse = other.output.copy()
    sparse[1::2, 1] = np.nan
    fitted, held_out = [replace(other, output=sparse)], [whole]
    assert prepare_estimation(model, held_out, "prediction").groups == [[0, 1]]
    estimation = prepare_estimation(model, fitted, "prediction", held_out)
    unseen = prepare_estimation(model, held_out, "prediction", fitted)
    assert estimation.groups == unseen.groups == [[0], [1]]
    assert transfer(unseen, refit(estimation, model)) is not None
