import json
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from idloop.errors import InputError
from idloop.estimation.black_box.sampled import SampledData
from idloop.estimation.polynomial import Orders, Polynomials, armax, arx, box_jenkins, output_error
from idloop.estimation.recursive import (
    RecursivePolynomial,
    pseudo_linear_regression,
    recursive_armax,
    recursive_arx,
    recursive_box_jenkins,
    recursive_output_error,
    recursive_prediction_error,
    track,
)

POLES = [1.0, -1.5, 0.7]
CASES = {
    "arx": (lambda **k: recursive_arx(2, 2, **k), lambda d: arx(d, 2, 2, errors="white"), {"a": POLES}),
    "armax": (lambda **k: recursive_armax(2, 2, 2, **k), lambda d: armax(d, 2, 2, 2), {"a": POLES, "c": [1, -1, 0.2]}),
    "oe": (
        lambda **k: recursive_output_error(2, 2, **k), lambda d: output_error(d, 2, 2, errors="white"), {"f": POLES},
    ),
    "bj": (
        lambda **k: recursive_box_jenkins(2, 1, 1, 2, **k), lambda d: box_jenkins(d, 2, 1, 1, 2),
        {"f": POLES, "c": [1, 0.5], "d": [1, -0.8]},
    ),
}  # fmt: skip


def values(model):
    return np.array([c.value for c in model.coefficients])


def stderr(model):
    return np.array([c.stderr for c in model.coefficients])


def rows(data, na, nb):
    """Regressors of an ARX model from rest, written down once more."""
    y, u = data.output[:, 0], data.input[:, 0]
    shift = lambda x, k: np.concatenate([np.zeros(k), x[:-k]])  # noqa: E731
    return np.column_stack([*(-shift(y, k + 1) for k in range(na)), *(shift(u, k + 1) for k in range(nb))]), y


@pytest.mark.parametrize("forgetting", [1.0, 0.97])
def test_recursive_least_squares_is_weighted_least_squares(made, forgetting):
    data = made(300, a=POLES)
    estimator = recursive_arx(2, 2, forgetting=forgetting, prior=1e6)
    estimator.update_block(data.input, data.output[:, 0])
    phi, y = rows(data, 2, 2)
    root = np.sqrt(forgetting ** np.arange(299, -1, -1))
    expected = np.linalg.lstsq(phi * root[:, None], y * root, rcond=None)[0]
    np.testing.assert_allclose(estimator.coefficients, expected, atol=1e-8)
    if forgetting == 1.0:
        from_rest = [np.vstack([np.zeros((2, 1)), one]) for one in (data.input, data.output)]
        batch = arx(replace(data, input=from_rest[0], output=from_rest[1]), 2, 2, errors="white")
        np.testing.assert_allclose(estimator.coefficients, values(batch), atol=1e-8)
        np.testing.assert_allclose(estimator.stderr, stderr(batch), rtol=0.03)


@given(cut=st.lists(st.integers(1, 60), min_size=1, max_size=6), case=st.sampled_from(sorted(CASES)))
def test_sample_by_sample_is_block_by_block(made, cut, case):
    make, _, system = CASES[case]
    data = made(200, **system)
    one, several = make(forgetting=0.99), make(forgetting=0.99)
    by_sample = [one.update(u, float(y[0])) for u, y in zip(data.input, data.output, strict=True)]
    edges = np.unique(np.clip(np.cumsum([0, *cut, 200]), 0, 200))
    by_block = [several.update_block(data.input[a:b], data.output[a:b, 0]) for a, b in pairwise(edges)]
    np.testing.assert_array_equal(by_sample, np.concatenate(by_block))
    np.testing.assert_array_equal(one.coefficients, several.coefficients)
    assert one.innovation == by_sample[-1]


@pytest.mark.parametrize("case", sorted(CASES))
def test_from_nothing_to_the_minimum_of_the_batch_estimate(made, case):
    make, batch, system = CASES[case]
    for seed in range(8):
        data = made(3000, seed, **system)
        estimator, model = make(), batch(data)
        estimator.update_block(data.input, data.output[:, 0])
        assert np.all(np.abs(estimator.coefficients - values(model)) < 2.0 * stderr(model))
        assert estimator.innovation_variance == pytest.approx(0.25, rel=0.1)
        # The covariance is the sum of the gradients' products: a wrong gradient would show here.
        np.testing.assert_allclose(estimator.stderr, stderr(model), rtol=0.15)


def test_error_falls_with_the_root_of_the_samples(made):
    truth = np.array([*POLES[1:], 1.0, 0.5, -1.0, 0.2])

    def error(samples):
        found = []
        for seed in range(20):
            data = made(samples, seed, a=POLES, c=[1, -1, 0.2])
            estimator = recursive_armax(2, 2, 2)
            estimator.update_block(data.input, data.output[:, 0])
            found.append(estimator.coefficients - truth)
        return np.sqrt(np.mean(np.square(found)))

    assert error(2000) / error(32000) == pytest.approx(4.0, rel=0.3)


def test_pseudo_linear_regression_converges_too_but_less_surely(made):
    truth = np.array([*POLES[1:], 1.0, 0.5, -1.0, 0.2])
    data = made(20000, 1, a=POLES, c=[1, -1, 0.2])
    plain, named = recursive_armax(2, 2, 2, method="pseudo-linear"), pseudo_linear_regression(na=2, nb=2, nc=2)
    for estimator in (plain, named):
        estimator.update_block(data.input, data.output[:, 0])
        np.testing.assert_allclose(estimator.coefficients, truth, atol=0.06)
    np.testing.assert_array_equal(plain.coefficients, named.coefficients)
    linear = [recursive_arx(2, 2), pseudo_linear_regression(na=2, nb=2)]
    for estimator in linear:
        estimator.update_block(data.input, data.output[:, 0])
    np.testing.assert_array_equal(linear[0].coefficients, linear[1].coefficients)


def test_general_structure_with_two_inputs():
    rng = np.random.default_rng(3)
    u, e = rng.normal(size=(20000, 2)), 0.3 * rng.normal(size=20000)
    y, w = np.zeros(20000), np.zeros(20000)
    for t in range(3, 20000):
        w[t] = 0.6 * w[t - 1] + 2.0 * u[t - 3, 1]
        y[t] = 0.8 * y[t - 1] + u[t, 0] + w[t] + e[t] + 0.5 * e[t - 1]
    estimator = recursive_prediction_error(
        na=1, nb=(1, 1), nc=1, nf=(0, 1), nk=(0, 3), input_names=("u", "v"), output_name="y"
    )
    estimator.update_block(u, y)
    assert estimator.names == ("a1", "b0[u]", "b3[v]", "c1", "f1[v]")
    np.testing.assert_allclose(estimator.coefficients, [-0.8, 1.0, 2.0, 0.5, -0.6], atol=0.04)
    model = estimator.polynomials
    assert model.delay == (0, 3)
    assert model.variance == pytest.approx(0.09, rel=0.1)


def test_standard_errors_with_forgetting_are_those_of_what_is_remembered(made):
    found, claimed = [], []
    for seed in range(150):
        data = made(400, seed, a=[1.0, -0.5])
        estimator = recursive_arx(1, 2, forgetting=0.97)
        estimator.update_block(data.input, data.output[:, 0])
        found.append(estimator.coefficients)
        claimed.append(estimator.stderr)
    np.testing.assert_allclose(np.std(found, axis=0), np.mean(claimed, axis=0), rtol=0.2)


@pytest.mark.parametrize("options", [{"forgetting": 0.98}, {"random_walk": [0.0, 0.05, 0.0]}])
def test_a_gain_that_jumps_is_followed_and_without_forgetting_it_is_not(made, options):
    first, second = made(1000, 0, a=[1, -0.5]), made(1000, 1, a=[1, -0.5], b=[0, 2.0, 0.5])
    followed, kept = recursive_arx(1, 2, **options), recursive_arx(1, 2)
    for estimator in (followed, kept):
        for data in (first, second):
            estimator.update_block(data.input, data.output[:, 0])
    assert followed.coefficients[1] == pytest.approx(2.0, abs=0.2)
    assert kept.coefficients[1] == pytest.approx(1.5, abs=0.2)


def test_a_random_walk_is_followed_as_well_as_the_riccati_equation_allows():
    rng = np.random.default_rng(4)
    n, walk, noise = 40000, 0.02, 0.5
    gain = 1.0 + np.cumsum(walk * rng.normal(size=n))
    u = rng.choice([-1.0, 1.0], n)
    y = np.concatenate([[0.0], gain[1:] * u[:-1]]) + noise * rng.normal(size=n)
    estimator = recursive_arx(0, 1, random_walk=walk)
    _, found, claimed = estimator.follow(u, y)
    # P = P r / (P + r) + q in the steady state, after the walk's step.
    q, r = walk**2, noise**2
    steady = 0.5 * (q + np.sqrt(q**2 + 4.0 * q * r))
    # The value after sample t is held against the gain of t + 1, which has walked once more.
    assert np.mean((found[2000:-1, 0] - gain[2001:]) ** 2) == pytest.approx(steady, rel=0.1)
    assert np.mean(claimed[2000:, 0] ** 2) == pytest.approx(steady, rel=0.1)
    assert estimator.innovation_variance == pytest.approx(r, rel=0.15)


def test_a_quiet_plant_neither_winds_up_nor_forgets_for_good(made):
    data = made(500, 0, a=[1, -0.5])
    estimator = recursive_arx(1, 2, forgetting=0.95)
    estimator.update_block(data.input, data.output[:, 0])
    learnt = estimator.coefficients
    estimator.forget_signals()
    estimator.update_block(np.zeros((200_000, 1)), np.zeros(200_000))
    assert np.all(np.isfinite(estimator.covariance))
    assert np.max(np.diag((estimator._upper * estimator._diagonal) @ estimator._upper.T)) <= 1e4 * (1 + 1e-9)
    np.testing.assert_allclose(estimator.coefficients, learnt, atol=0.05)
    again = made(200, 1, a=[1, -0.5])
    estimator.update_block(again.input, again.output[:, 0])
    np.testing.assert_allclose(estimator.coefficients, [-0.5, 1.0, 0.5], atol=0.4)


def test_one_silent_input_does_not_stop_the_other_from_being_followed():
    rng = np.random.default_rng(5)
    u = np.column_stack([rng.choice([-1.0, 1.0], 4000), np.zeros(4000)])
    gain = np.where(np.arange(4000) < 2000, 1.0, 3.0)
    y = np.concatenate([[0.0], gain[1:] * u[:-1, 0]]) + 0.1 * rng.normal(size=4000)
    estimator = recursive_arx(0, (1, 1), forgetting=0.98)
    estimator.update_block(u, y)
    assert estimator.coefficients[0] == pytest.approx(3.0, abs=0.1)
    assert estimator.coefficients[1] == 0.0


@pytest.mark.parametrize("case", sorted(CASES))
def test_looking_on_changes_nothing(made, case):
    make, _, system = CASES[case]
    data = made(300, **system)
    alone, watched = make(), make()
    alone.update_block(data.input, data.output[:, 0])
    watched.follow(data.input, data.output[:, 0], every=7)
    np.testing.assert_array_equal(alone.coefficients, watched.coefficients)
    np.testing.assert_array_equal(alone.covariance, watched.covariance)


def test_the_covariance_stays_positive_over_many_samples_of_collinear_signals():
    rng = np.random.default_rng(6)
    slow = np.cumsum(rng.normal(size=100_000)) * 1e-3
    u = np.column_stack([slow, slow + 1e-9 * rng.normal(size=100_000)])
    estimator = recursive_arx(3, (2, 2), forgetting=0.999)
    estimator.update_block(u, np.concatenate([[0.0], slow[:-1]]))
    assert np.all(estimator._diagonal >= 0.0)
    assert np.all(np.isfinite(estimator.coefficients))
    assert np.linalg.eigvalsh(estimator.covariance)[0] >= -1e-12 * np.trace(estimator.covariance)


@given(st.integers(0, 30))
def test_steps_that_would_make_the_predictor_run_away_are_shortened(seed):
    # White noise for an output, a huge prior and no warm-up: nothing keeps C and F in but the projection.
    rng = np.random.default_rng(seed)
    estimator = recursive_box_jenkins(2, 2, 1, 2, prior=1e3, warm_up=0.0, forgetting=0.95)
    innovations = estimator.update_block(rng.normal(size=500), rng.normal(size=500))
    model = estimator.polynomials
    assert np.max(np.abs(np.roots(model.c))) <= 0.9991
    assert np.max(np.abs(np.roots(model.f[0]))) <= 0.9991
    assert np.all(np.isfinite(innovations))
    assert estimator.projections > 0


def test_missing_samples_teach_nothing(made):
    data = made(1500, 0, f=POLES)
    y = data.output[:, 0].copy()
    y[700:720] = np.nan
    estimator = recursive_output_error(2, 2)
    innovations = estimator.update_block(data.input, y)
    assert np.all(np.isnan(innovations[700:720]))
    assert estimator.samples == 1480
    np.testing.assert_allclose(estimator.coefficients, [1.0, 0.5, *POLES[1:]], atol=0.1)
    before = estimator.coefficients
    assert np.isnan(estimator.update(float("nan"), float("nan")))
    np.testing.assert_array_equal(estimator.coefficients, before)


@given(st.floats(-8, 8), st.floats(-8, 8))
def test_scales_make_units_irrelevant(made, command, measurement):
    k, g = 10.0**command, 10.0**measurement
    data = made(300, a=POLES, c=[1, 0.5])
    plain = recursive_armax(2, 2, 1, input_scale=1.0, output_scale=1.0)
    scaled = recursive_armax(2, 2, 1, input_scale=k, output_scale=g)
    measured = g * data.output[:, 0]
    left = plain.update_block(data.input, data.output[:, 0])
    np.testing.assert_allclose(scaled.update_block(k * data.input, measured), g * left, rtol=1e-6, atol=1e-9 * g)
    unit = np.array([1, 1, g / k, g / k, 1])
    np.testing.assert_allclose(scaled.coefficients, unit * plain.coefficients, rtol=1e-6)
    np.testing.assert_allclose(scaled.stderr, unit * plain.stderr, rtol=1e-6)


@given(st.floats(-8, 8), st.floats(-8, 8))
def test_without_scales_the_first_samples_tell_them(made, command, measurement):
    k, g = 10.0**command, 10.0**measurement
    data = made(500, a=POLES, c=[1, 0.5])
    plain, moved = recursive_armax(2, 2, 1), recursive_armax(2, 2, 1)
    plain.update_block(data.input, data.output[:, 0])
    moved.update_block(k * data.input, g * data.output[:, 0])
    np.testing.assert_allclose(moved.coefficients, np.array([1, 1, g / k, g / k, 1]) * plain.coefficients, rtol=1e-6)


def test_a_start_is_gone_on_from(made):
    data = made(500, 0, a=POLES, c=[1, 0.5])
    model = armax(data, 2, 2, 1).polynomials[0]
    estimator = RecursivePolynomial(
        model.orders, start=model, prior=0.01, warm_up=0.0, input_scale=1.0, output_scale=1.0
    )
    np.testing.assert_array_equal(estimator.coefficients, model.vector)
    later = made(300, 1, a=POLES, c=[1, 0.5])
    assert np.std(estimator.update_block(later.input, later.output[:, 0])[20:]) == pytest.approx(0.5, rel=0.15)
    live = estimator.polynomials.model()
    later = SampledData("later", later.input, later.output, live.sample_time)
    assert np.std(live.innovations(later)) == pytest.approx(0.5, rel=0.15)


def test_a_record_is_tracked_and_drawn(made):
    parts = [made(300, 0, a=POLES), made(200, 1, a=POLES)]
    estimator = recursive_arx(2, 2, input_names=("u",), output_name="y")
    history = track(estimator, parts, every=10)
    assert history.values.shape == history.stderr.shape == (50, 4)
    assert history.innovations.shape == (500,)
    assert history.time[0] == pytest.approx(0.9)
    assert history.time[-1] == pytest.approx(49.9)
    np.testing.assert_array_equal(history.values[-1], estimator.coefficients)
    np.testing.assert_allclose(history.stderr[-1], estimator.stderr)
    assert isinstance(history.final, Polynomials)
    document = json.loads(json.dumps(history.to_dict(), default=lambda array: array.tolist()))
    assert document["names"] == ["a1", "a2", "b1[u]", "b2[u]"]


def test_coefficients_of_each_instant_are_judged_one_step_ahead(made):
    first, second = made(600, 0, a=POLES), made(600, 1, a=POLES, b=[0, 0.4, 0.2])
    data = [first, second]
    history = track(recursive_arx(2, 2, drift=5e-3), data)
    measured = np.concatenate([one.output[:, 0] for one in data])
    np.testing.assert_array_equal(history.measured, measured)
    errors = np.linalg.norm(history.innovations) / np.linalg.norm(measured - measured.mean())
    assert history.fit == pytest.approx(100.0 * (1.0 - errors))
    assert history.to_dict()["fit_on_the_way"] == history.fit


def test_memory_does_not_grow(made):
    data = made(2000, a=POLES)
    estimator = recursive_arx(2, 2)
    held = lambda: sum(v.nbytes for v in vars(estimator).values() if isinstance(v, np.ndarray))  # noqa: E731
    estimator.update_block(data.input[:100], data.output[:100, 0])
    before = held()
    estimator.update_block(data.input[100:], data.output[100:, 0])
    assert held() == before


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: recursive_arx(1, 1, forgetting=1.5), "forgetting must be in"),
        (lambda: recursive_arx(1, 1, random_walk=-1.0), "random_walk"),
        (lambda: recursive_arx(1, 1, input_scale=0.0), "above 0"),
        (lambda: recursive_arx(1, 1, method="magic"), "'magic' is unknown"),
        (lambda: recursive_arx(1, (1, 1), input_names=("u",)), "1 input names for 2 inputs"),
        (lambda: recursive_arx(1, 1, start=[1.0]), "start of shape"),
        (lambda: recursive_output_error(1, 1, start=[1.0, -1.5]), "outside the circle"),
        (lambda: recursive_arx(1, 1).update_block(np.zeros(3), np.zeros(4)), "give \\(n, 1\\) and \\(n,\\)"),
        (lambda: recursive_arx(1, 1).update(np.inf, 0.0), "infinite"),
        (lambda: recursive_arx(1, 1).follow([0.0], [0.0], every=0), "at least 1 sample"),
        (
            lambda: track(recursive_arx(1, 1), SampledData("two", np.zeros((9, 2)), np.zeros((9, 1)), 0.1, ("u", "v"),
                                                           ("V", "V"))),
            "2 inputs",
        ),
        (lambda: RecursivePolynomial(Orders(1, (1,), 0, 0, (0,), (1,)), start=armax_start()), "has the orders"),
    ],
)  # fmt: skip
def test_bad_input_is_one_line(call, message):
    with pytest.raises(InputError, match=message) as caught:
        call()
    assert "\n" not in str(caught.value)


def armax_start():
    orders = Orders(1, (1,), 1, 0, (0,), (1,))
    return Polynomials.from_vector(orders, np.zeros(3), sample_time=1.0, input_names=("u",), output_name="y")
