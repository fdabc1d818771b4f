"""Scores of black-box models: pooled FIT, prediction some steps ahead, residual tests."""

from __future__ import annotations

import numpy as np
import pytest

from idloop.errors import InputError
from idloop.estimation.black_box.sampled import SampledData
from idloop.estimation.linear import LinearModel
from idloop.validation import fit_percent
from idloop.validation.score import fit_difference, pooled_fit, score


def model(pole=0.9, gain=0.3):
    return LinearModel(
        method="known", a=np.array([[pole]]), b=np.ones((1, 1)), c=np.ones((1, 1)), d=np.zeros((1, 1)),
        gain=np.array([[gain]]), covariance=np.eye(1), sample_time=0.1, input_names=("u",), input_units=("V",),
        output_names=("y",), output_units=("rad",), samples=100, free=2,
    )  # fmt: skip


def data(samples=600, seed=0, offset=0.0):
    random = np.random.default_rng(seed)
    u, e = random.normal(size=(samples, 1)), 0.5 * random.normal(size=samples)
    x, y = 0.0, np.zeros((samples, 1))
    for k in range(samples):
        y[k] = x + e[k]
        x = 0.9 * x + u[k, 0] + 0.3 * e[k]
    return SampledData("run", u, y + offset, 0.1, ("u",), ("V",), ("y",), ("rad",))


def test_one_record_scores_as_fit_percent_does():
    one = data()
    run = model().simulate(one)
    assert pooled_fit([one], [run])[0] == pytest.approx(fit_percent(one.output, run)[0])


def test_offsets_between_records_do_not_flatter():
    near, far = data(seed=1), data(seed=2, offset=1000.0)
    zero = [np.zeros_like(near.output), np.full_like(far.output, 1000.0)]
    # The means of both records explain nothing of what moves in them.
    assert abs(pooled_fit([near, far], zero)[0]) < 10.0


def test_the_right_model_leaves_white_errors_and_a_near_prediction_is_better():
    found = score(model(), [data(5000), data(seed=3)], steps=1)
    assert found.ahead[0] > found.free_run[0]
    assert found.tests[0].white
    assert found.tests[0].input_free
    assert not score(model(gain=0.0), [data(5000)]).tests[0].white
    document = found.to_dict()
    assert document["ahead"]["fit"]["y"] == document["ahead"]["mean_fit"] == found.ahead[0]
    assert len(found.simulated) == 2


def test_a_model_that_runs_away_scores_minus_infinity():
    away = score(model(pole=8.0), [data(5000)])
    assert away.free_run[0] == -np.inf
    assert away.tests == ()


def test_short_data_has_no_tests_and_no_data_no_score():
    assert score(model(), [data(80)]).tests == ()
    with pytest.raises(InputError, match="no data"):
        score(model(), [])


def test_a_difference_of_free_runs_knows_how_certain_it_is():
    right, record = model(), data(4000)
    scores = [score(one, [record]) for one in (right, model(0.9 + 1e-5), model(0.8))]
    difference, stderr = fit_difference([record], scores[0], scores[2])
    assert difference == pytest.approx(scores[0].free_run[0] - scores[2].free_run[0])
    assert difference > 4 * stderr
    difference, stderr = fit_difference([record], scores[0], scores[1])
    assert 0 < stderr < 0.1
    assert abs(difference) < 3 * stderr
    assert fit_difference([record], scores[0], scores[0]) == (0.0, 0.0)


@pytest.mark.slow
def test_the_uncertainty_of_a_difference_is_that_of_repeated_records():
    pair, found = (model(), model(0.9 + 3e-4)), []
    for seed in range(60):
        record = data(2000, seed)
        found.append(fit_difference([record], *(score(one, [record]) for one in pair)))
    differences, stderrs = np.array(found).T
    assert np.median(stderrs) == pytest.approx(np.std(differences), rel=0.35)
