"""The suite holds what it promises, and one seed gives one suite."""

from __future__ import annotations

from collections import Counter
from zlib import crc32

import numpy as np
import pytest
from case import Hidden
from cases import all_cases, cases_of
from experiment import experiment, record, start_model, true_model
from machines import MACHINES, base_model
from plan import SINGLES
from sizes import Sizes

from idloop.estimation.dataset import prepare
from idloop.estimation.force_balance.window_width import fit_by_force
from idloop.estimation.optimisation.caching_engine import CachingEngine
from idloop.physics import catalogue


@pytest.fixture(scope="module")
def planned():
    """Every case, with strengths for which no machine was run: what the plan alone decides."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("cases.hidden", lambda effect, at, *_: Hidden(effect, at, {}))
        patch.setattr("realistic.sizes", lambda *_: Sizes(1.0, 1.0, 1.0, 1.0, 1.0, 1.0, (1.0,) * 3, (1.0,) * 3))
        return cases_of(lambda _: True)


@pytest.fixture(scope="module", params=["sample", pytest.param("all", marks=pytest.mark.slow)])
def cases(request):
    """A sixth of the cases, or all of them."""
    return cases_of(lambda case_id: request.param == "all" or crc32(case_id.encode()) % 6 == 0)


def test_at_least_five_hundred_cases_with_two_hundred_clean_ones(planned):
    count = Counter(case.category for case in planned)
    assert len(planned) >= 500
    assert count["clean"] >= 200
    assert min(count.values()) >= 30


def test_half_of_the_clean_cases_are_disturbed_by_coloured_noise(planned):
    clean = [case for case in planned if case.category == "clean"]
    assert sum("ar" in (case.disturbance.kind, case.noise.kind) for case in clean) >= 100
    assert all(case.duration <= 20.0 for case in clean)


def test_a_third_is_simulated_by_code_that_shares_nothing_with_ours(planned):
    for category in {case.category for case in planned}:
        own = [case for case in planned if case.category == category]
        assert sum(case.simulator != "idloop" for case in own) >= len(own) / 3


def test_every_effect_of_the_catalogue_is_hidden_somewhere():
    # But for what depends on a condition that is measured beside the axis, acts in the loop of a drive, or along a
    # length: it has none of them.
    assert {row.effect for row in SINGLES} == {
        name
        for name, several in catalogue().items()
        if not any(one.condition or one.of_loop or one.any_period for one in several)
    }


def test_no_case_is_too_long(planned):
    assert all(case.rate * case.duration * len(case.training) <= 30_000 for case in planned)


def test_every_true_model_can_be_built_and_the_start_model_knows_nothing_of_it(cases):
    for case in cases:
        truth, start = true_model(case), start_model(case, 1)
        base = base_model(case.machine, case.rate, case.loop)
        assert set(case.truth) <= set(truth.effect_names)
        assert start.effect_names == ()
        for name in start.free:
            assert 0.19 < abs(start.values[name] / base.values[name] - 1.0) < 0.41


@pytest.mark.slow
@pytest.mark.parametrize("simulator", ["idloop", "equations", "mujoco"])
def test_one_seed_gives_one_experiment(simulator):
    if simulator == "mujoco":
        pytest.importorskip("mujoco", reason="mujoco is not installed (optional extra 'benchmark')")
    case = min(
        (c for c in all_cases() if c.simulator == simulator and c.loop == "closed" and c.category == "single"),
        key=lambda c: c.rate * c.duration * len(c.training),
    )
    first, again, other = experiment(case), experiment(case), experiment(case, suite=2)
    assert np.array_equal(first.training[0].output, again.training[0].output)
    assert not np.array_equal(first.training[0].output, other.training[0].output)
    assert np.all(np.isfinite(first.training[0].output))
    assert first.training[0].reference is not None


@pytest.mark.slow
def test_no_closed_loop_swings_up_because_the_command_comes_late():
    closed = [case for case in all_cases() if case.loop == "closed"]
    late = [case for case in closed if any(h.at == "input" and "delay" in h.values for h in case.hidden)]
    assert len(late) > 3
    for case in late:
        drive = record(case, case.training[0], 1, "train0")
        assert np.max(np.abs(drive.input)) < 100.0 * MACHINES[case.machine].command, case.id


def test_a_torque_that_wanders_takes_no_inertia_away():
    (case,) = cases_of("clean/walk/torsion/17".__eq__)
    data = experiment(case, suite=11)
    balance = fit_by_force(CachingEngine(data.start), prepare(data.start, data.training), data.start.theta)
    assert balance is None or np.all(balance.form.inertia(balance.theta) > 1e-8)


def test_the_cases_of_some_ids_are_those_of_the_list(cases):
    for case in {case.category: case for case in cases}.values():
        assert cases_of(case.id.__eq__) == (case,)
