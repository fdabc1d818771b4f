import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import cont2discrete, lfilter

from idloop.errors import InputError
from idloop.estimation.black_box.sampled import SampledData
from idloop.estimation.polynomial import Orders, armax, box_jenkins, output_error
from idloop.estimation.polynomial.regression import Channel
from idloop.estimation.polynomial.search import Objective

OUTPUT = {"a": [1.0], "f": [1.0, -1.5, 0.7]}
ARMAX = {"c": [1.0, -1.0, 0.2]}
BOX = OUTPUT | {"c": [1.0, 0.5], "d": [1.0, -0.8]}


def values(model):
    return np.array([c.value for c in model.coefficients])


def stderr(model):
    return np.array([c.stderr for c in model.coefficients])


@given(
    seed=st.integers(0, 50),
    orders=st.sampled_from([
        Orders(2, (2, 1), 2, 1, (2, 1), (1, 0)), Orders(0, (2, 1), 0, 0, (2, 1), (1, 3)),
        Orders(1, (2, 0), 1, 0, (0, 0), (1, 0)), Orders(0, (1, 2), 1, 2, (1, 2), (0, 2)),
    ]),
)  # fmt: skip
def test_slopes_are_the_gradient_of_the_errors(seed, orders):
    rng = np.random.default_rng(seed)
    u, y = rng.normal(size=(50, 2)), rng.normal(size=50).cumsum()
    objective = Objective([Channel(y, u), Channel(y[20:], u[:30])], orders)
    point = 0.15 * rng.normal(size=orders.size)

    def half(theta):
        return 0.5 * sum(e @ e for e in objective.errors(theta))

    gradient = np.vstack(objective.slopes(point)).T @ np.concatenate(objective.errors(point))
    steps = 1e-5 * np.eye(orders.size)
    numerical = np.array([(half(point + d) - half(point - d)) / 2e-5 for d in steps])
    np.testing.assert_allclose(gradient, numerical, atol=1e-6 * np.abs(gradient).max())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("estimator", "system", "truth"),
    [
        (lambda d: armax(d, 2, 2, 2), ARMAX, [-1.5, 0.7, 1.0, 0.5, -1.0, 0.2]),
        (lambda d: output_error(d, 2, 2), OUTPUT, [1.0, 0.5, -1.5, 0.7]),
        (lambda d: box_jenkins(d, 2, 1, 1, 2), BOX, [1.0, 0.5, 0.5, -0.8, -1.5, 0.7]),
    ],
)  # fmt: skip
def test_no_bias_and_honest_standard_errors(made, estimator, system, truth):
    models = [estimator(made(500, seed, **system)) for seed in range(30)]
    found, claimed = np.array([values(m) for m in models]), np.mean([stderr(m) for m in models], axis=0)
    bias = np.abs(found.mean(axis=0) - truth)
    assert np.all(bias < 4 * claimed / np.sqrt(len(found)) + 0.01)
    np.testing.assert_allclose(found.std(axis=0), claimed, rtol=0.45)
    assert np.mean([m.loss for m in models]) == pytest.approx(0.25, rel=0.05)


@pytest.mark.slow
def test_error_falls_with_the_root_of_the_samples(made):
    truth = [-1.5, 0.7, 1.0, 0.5, -1.0, 0.2]
    errors = [
        np.sqrt(np.mean([(values(armax(made(n, s, **ARMAX), 2, 2, 2)) - truth) ** 2 for s in range(12)]))
        for n in (400, 6400)
    ]
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.4)


@pytest.mark.slow
def test_output_error_is_honest_in_coloured_noise(made):
    models = [output_error(made(800, seed, **BOX), 2, 2) for seed in range(40)]
    found = np.array([values(m) for m in models])
    np.testing.assert_allclose(found.std(axis=0), np.mean([stderr(m) for m in models], axis=0), rtol=0.35)
    assert np.all(np.abs(found.mean(axis=0) - [1.0, 0.5, -1.5, 0.7]) < 0.03)


def test_feedback_biases_the_model_without_the_noise_but_not_the_true_structure(looped):
    data = looped(20000, 2)
    model = armax(data, 1, 1, 1)
    assert values(model) == pytest.approx([-0.8, 1.0, 0.7], abs=0.03)
    poor = output_error(data, 1, 1)
    assert abs(values(poor)[0] - 1.0) > 0.1


def test_unstable_plant_in_a_loop(looped):
    model = armax(looped(5000, 3, pole=1.2), 1, 1, 1)
    assert values(model) == pytest.approx([-1.2, 1.0, 0.7], abs=0.06)
    assert not model.stable


def test_predictions_of_the_model_are_those_that_were_minimised(made):
    for estimator in (lambda d: armax(d, 2, 2, 2), lambda d: box_jenkins(d, 2, 1, 1, 2)):
        data = made(1500, 4, **ARMAX)
        model = estimator(data)
        assert np.var(model.innovations(data)) == pytest.approx(model.loss, rel=0.01)


@pytest.mark.parametrize("noise", [0.0, 0.9])
def test_two_light_resonances_are_found_from_a_smooth_command(noise):
    w = 2 * np.pi
    den = np.convolve([1, 0.02 * w, w**2], [1, 0.06 * w, 9 * w**2])
    num, den, _ = cont2discrete(([9 * w**4], den), 0.02)
    rng = np.random.default_rng(1)
    u = np.repeat(rng.normal(size=1000), 10)
    clean = lfilter(num.ravel(), den, u)
    y = clean + 0.2 * clean.std() * lfilter([np.sqrt(1 - noise**2)], [1.0, -noise], rng.normal(size=10000))
    data = SampledData("resonant", u[:, None], y[:, None], 0.02)
    run = output_error(data, 4, 4).simulate(data)[:, 0]
    assert np.linalg.norm(run - clean) < 0.06 * np.linalg.norm(clean)


def test_position_of_a_motor_that_starts_anywhere():
    num, den, _ = cont2discrete(([8.255], [1, 2.306, 0]), 0.1)
    rng = np.random.default_rng(2)
    u = np.repeat(rng.choice([-1.0, 1.0], 300), 5)
    y = 3.0 + lfilter(num.ravel(), den, u) + 0.03 * rng.normal(size=1500)
    model = output_error(SampledData("motor", u[:, None], y[:, None], 0.1), 2, 2)
    error = np.abs(values(model) - [*num[0, 1:], *den[1:]])
    assert np.all(error < 4 * stderr(model))
    assert np.max(np.abs(model.poles)) == pytest.approx(1.0, abs=1e-3)


def test_inputs_have_their_own_denominators_and_delays():
    rng = np.random.default_rng(3)
    u = rng.normal(size=(3000, 2))
    y = lfilter([0, 1, 0.5], [1, -1.5, 0.7], u[:, 0]) + lfilter([0, 0, 0, 2.0], [1, -0.9], u[:, 1])
    y += 0.3 * lfilter([1], [1, -0.5], rng.normal(size=3000))
    data = SampledData("two", u, y[:, None], 0.1, ("u", "v"), ("V", "N"), ("y",), ("rad",))
    model = box_jenkins(data, (2, 1), 0, 1, (2, 1), (1, 3))
    truth = np.array([1.0, 0.5, 2.0, -0.5, -1.5, 0.7, -0.9])
    assert np.all(np.abs(values(model) - truth) < 4 * stderr(model))
    assert [c.name for c in model.coefficients][2] == "b3[v]"


@pytest.mark.parametrize("estimator", [
    lambda d: armax(d, 2, 2, 2, focus="simulation"), lambda d: box_jenkins(d, 2, 2, 2, 2, focus="simulation"),
])  # fmt: skip
def test_simulation_focus_gives_the_plant_of_the_free_run_and_then_a_noise_model(made, estimator):
    data = made(3000, 5, **ARMAX)
    model, reference = estimator(data), output_error(data, 2, 2)
    np.testing.assert_allclose(
        model.response(np.array([0.1, 1.0])), reference.response(np.array([0.1, 1.0])), rtol=1e-2
    )
    assert model.loss < 0.8 * reference.loss
    assert np.all(np.isfinite(stderr(model)))


def test_several_experiments_with_their_own_pasts(made):
    parts = [made(300, seed, discard=5 + seed, **OUTPUT) for seed in range(6)]
    model = output_error(parts, 2, 2)
    assert np.all(np.abs(values(model) - [1.0, 0.5, -1.5, 0.7]) < 4 * stderr(model))


def test_exact_data_and_extreme_units(made):
    data = made(300, noise=0.0, **OUTPUT)
    np.testing.assert_allclose(values(output_error(data, 2, 2)), [1.0, 0.5, -1.5, 0.7], atol=1e-8)
    noisy = made(600, **OUTPUT)
    moved = SampledData("moved", 1e-6 * noisy.input, 1e9 * noisy.output, 0.1)
    found = values(output_error(moved, 2, 2)) / [1e15, 1e15, 1.0, 1.0]
    np.testing.assert_allclose(found, values(output_error(noisy, 2, 2)), rtol=1e-4)


def test_outputs_are_fitted_one_by_one_and_share_the_covariance(made):
    data = made(1000, 6, **OUTPUT)
    pair = SampledData(
        "pair", data.input, np.hstack([data.output, -2.0 * data.output]), 0.1, ("u",), ("V",), ("y", "z"), ("rad",) * 2
    )
    model = output_error(pair, 2, 2)
    np.testing.assert_allclose(model.covariance / model.covariance[0, 0], [[1, -2], [-2, 4]], rtol=1e-3)
    assert model.coefficients[4].name == "z.b1[u]"
    assert model.coefficient_covariance.shape == (8, 8)


def test_a_noise_model_that_differences_too_often_is_named():
    rng = np.random.default_rng(0)
    u = rng.normal(size=(600, 1))
    y = np.diff(lfilter([0, 1.0], [1, -0.5], u[:, 0]) + rng.normal(size=600), prepend=0.0)
    model = box_jenkins(SampledData("differenced", u, y[:, None], 0.1), 2, 1, 0, 1)
    assert "unit circle" in model.notes[0]


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda d: output_error(d, 2, (2, 2)), "nf has 2 entries"),
        (lambda d: armax(d.part(0, 9), 3, 3, 3), "record longer"),
        (lambda d: armax(d, 0, 0, 0), "nothing to estimate"),
    ],
)
def test_bad_input_is_one_line(made, call, message):
    with pytest.raises(InputError, match=message) as caught:
        call(made(200))
    assert "\n" not in str(caught.value)
