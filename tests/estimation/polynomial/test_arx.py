import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import lfilter

import control
from idloop.errors import InputError
from idloop.estimation.black_box.sampled import SampledData
from idloop.estimation.polynomial import arx, iv4

TRUE = np.array([-1.5, 0.7, 1.0, 0.5])


def values(model):
    return np.array([c.value for c in model.coefficients])


def stderr(model):
    return np.array([c.stderr for c in model.coefficients])


def spread(estimator, made, seeds=120, samples=400, **system):
    models = [estimator(made(samples, seed, **system)) for seed in range(seeds)]
    found = np.array([values(m) for m in models])
    return found, np.mean([stderr(m) for m in models], axis=0)


@pytest.mark.parametrize("errors", ["white", "coloured"])
def test_standard_errors_of_least_squares_are_those_of_repeated_experiments(made, errors):
    found, claimed = spread(lambda d: arx(d, 2, 2, errors=errors), made)
    np.testing.assert_allclose(found.std(axis=0), claimed, rtol=0.25)
    assert np.all(np.abs(found.mean(axis=0) - TRUE) < 4 * claimed / np.sqrt(len(found)) + 2e-3)


def test_error_falls_with_the_root_of_the_samples(made):
    errors = [
        np.sqrt(np.mean([(values(arx(made(n, seed), 2, 2)) - TRUE) ** 2 for seed in range(30)])) for n in (200, 3200)
    ]
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.3)


def test_too_poor_a_noise_model_needs_the_sandwich():
    # Slow noise behind a slow command: the classical standard errors promise far too much.
    found, claimed = [], {"white": [], "coloured": []}
    for seed in range(100):
        rng = np.random.default_rng(seed)
        u, noise = lfilter([1.0], [1.0, -0.9], rng.normal(size=(2, 1000)))
        data = SampledData("slow", u[:, None], (lfilter([0.0, 1.0], [1.0], u) + noise)[:, None], 0.1)
        found.append(values(arx(data, 0, 1))[0])
        for errors, numbers in claimed.items():
            numbers.append(stderr(arx(data, 0, 1, errors=errors))[0])
    assert np.mean(claimed["coloured"]) == pytest.approx(np.std(found), rel=0.25)
    assert np.mean(claimed["white"]) < 0.5 * np.std(found)


def test_instruments_have_no_bias_where_least_squares_has(made):
    system = {"a": [1.0], "f": [1.0, -1.5, 0.7], "noise": 1.0}
    found, claimed = spread(lambda d: iv4(d, 2, 2), made, samples=1000, seeds=80, **system)
    assert np.all(np.abs(found.mean(axis=0) - TRUE) < 4 * claimed / np.sqrt(len(found)))
    np.testing.assert_allclose(found.std(axis=0), claimed, rtol=0.3)
    biased, _ = spread(lambda d: arx(d, 2, 2), made, samples=1000, seeds=10, **system)
    assert np.max(np.abs(biased.mean(axis=0) - TRUE)) > 0.05


@pytest.mark.parametrize("order", (3, 4))
def test_instruments_find_a_resonance_in_sensor_noise_that_turns_least_squares_upside_down(order):
    # Least squares of this order put a pole outside the circle, and instruments of such a model are of no use.
    pole = np.exp(2 * np.pi * 12.0 * 0.005 * (-0.05 + 1j))
    a = np.real(np.poly([pole, pole.conj(), 0.975]))
    random = np.random.default_rng(0)
    u = np.repeat(random.choice([-1.0, 1.0], 3000), 2)
    clean = lfilter([0.0, 1.0, -1.8, 0.9], a, u)
    y = clean + 0.1 * np.std(clean) * random.normal(size=u.size)
    found = iv4(SampledData("axis", u[:, None], y[:, None], 0.005), order, order)
    free = found.simulate(SampledData("axis", u[:, None], clean[:, None], 0.005))[:, 0]
    assert np.std(free - clean) < 0.02 * np.std(clean)


def test_feedback_biases_instruments_of_the_command_but_not_least_squares_of_the_true_structure(looped):
    data = looped(20000, 1, c=(1.0, 0.0))
    assert values(arx(data, 1, 1)) == pytest.approx([-0.8, 1.0], abs=0.03)
    coloured = looped(20000, 1)
    assert abs(values(arx(coloured, 1, 1))[0] + 0.8) > 0.1
    assert abs(values(iv4(coloured, 1, 1))[1] - 1.0) > 0.05


def test_instruments_of_the_reference_have_no_bias_under_feedback(looped):
    models = [iv4(looped(2000, seed), 1, 1, instruments="reference") for seed in range(60)]
    found = np.array([values(m) for m in models])
    claimed = np.mean([stderr(m) for m in models], axis=0)
    assert np.all(np.abs(found.mean(axis=0) - [-0.8, 1.0]) < 4 * claimed / np.sqrt(len(found)) + 0.01)
    np.testing.assert_allclose(found.std(axis=0), claimed, rtol=0.35)


@given(scale_in=st.floats(-9, 9), scale_out=st.floats(-9, 9))
def test_units_change_nothing_but_the_units(made, scale_in, scale_out):
    data = made(200)
    k, g = 10.0**scale_in, 10.0**scale_out
    moved = SampledData("moved", k * data.input, g * data.output, 0.1, ("u",), ("V",), ("y",), ("rad",))
    for estimator in (arx, iv4):
        expected = values(estimator(data, 2, 2)) * [1, 1, g / k, g / k]
        np.testing.assert_allclose(values(estimator(moved, 2, 2)), expected, rtol=1e-6)


def test_two_halves_are_one_record_but_for_the_rows_between(made):
    data = made(4000)
    halves = [data.part(0, 2000), data.part(2000, 4000)]
    np.testing.assert_allclose(values(arx(halves, 2, 2)), values(arx(data, 2, 2)), atol=2e-3)
    assert arx(halves, 2, 2).samples == 4000 - 4


def test_without_noise_the_system_comes_out_exactly_from_any_first_state(made):
    data = made(200, noise=0.0)
    for estimator in (arx, iv4):
        np.testing.assert_allclose(values(estimator(data, 2, 2)), TRUE, atol=1e-9)


def test_too_high_an_order_on_exact_data_says_so_and_still_predicts(made):
    data = made(300, noise=0.0)
    model = arx(data, 5, 5)
    assert "do not determine" in model.notes[0]
    assert np.isnan(stderr(model)).any()
    np.testing.assert_allclose(model.simulate(data), data.output, atol=1e-6)


def test_inputs_that_are_alike_are_named(made):
    data = made(300)
    twice = SampledData(
        "twice", np.hstack([data.input] * 2), data.output, 0.1, ("u", "v"), ("V", "V"), ("y",), ("rad",)
    )
    model = arx(twice, 2, 2)
    assert "b1[u], b2[u], b1[v], b2[v]" in model.notes[0]
    np.testing.assert_allclose(values(model)[2:4] + values(model)[4:], values(arx(data, 2, 2))[2:], atol=1e-9)


def test_weighting_chooses_the_frequencies_that_a_poor_model_fits(made):
    data = made(20000, noise=0.1)
    low = arx(data, 1, 1, prefilter=([0.05], [1.0, -0.95]))
    plain = arx(data, 1, 1)
    truth = 1.5 / 0.2
    gains = [abs(abs(m.response(np.array([1e-4]))[0, 0, 0]) - truth) for m in (low, plain)]
    assert gains[0] < 0.5 * gains[1]


def test_a_filter_may_be_a_control_system(made):
    data = made(500)
    by_pair = arx(data, 2, 2, prefilter=([0.0, 0.05], [1.0, -0.95]))
    by_system = arx(data, 2, 2, prefilter=control.tf([0.05], [1.0, -0.95], 0.1))
    np.testing.assert_allclose(values(by_system), values(by_pair))
    assert np.max(np.abs(values(by_pair) - values(arx(data, 2, 2)))) > 0.1


def test_the_free_run_of_a_simulation_focus_fits_better(made):
    data = made(3000, noise=1.0, a=[1.0], f=[1.0, -1.5, 0.7])
    runs = [arx(data, 2, 2, focus=f).simulate(data) for f in ("simulation", "prediction")]
    errors = [np.mean((run - data.output) ** 2) for run in runs]
    assert errors[0] < errors[1]
    assert errors[0] == pytest.approx(1.0, rel=0.1)


def test_the_result_is_json_and_knows_its_criteria(made):
    model = arx(made(300), 2, 2)
    document = json.loads(json.dumps(model.to_dict(), default=lambda array: array.tolist()))
    assert document["coefficients"]["b1[u]"]["value"] == pytest.approx(1.0, abs=0.2)
    assert document["polynomials"][0]["delay"] == [1]
    assert model.free == 4
    assert model.samples == 298


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda d: arx(d, 2, (2, 2)), "nb has 2 entries for 1 input"),
        (lambda d: arx(d.part(0, 6), 3, 3), "usable samples"),
        (lambda d: arx(d, 2, 2, prefilter=([1.0], [1.0, -1.5])), "stable roots"),
        (lambda d: arx(d, 2, 2, prefilter=control.tf([1.0], [1.0, 1.0])), "make it discrete at 0.1 s"),
        (lambda d: iv4(d, 2, 0), "nb is 0"),
        (lambda d: iv4(d, 2, 2, instruments="reference"), "no reference"),
        (lambda d: arx([], 2, 2), "no data"),
        (lambda d: arx(SampledData("still", 0.0 * d.input, d.output, 0.1), 2, 2), "is 0 throughout"),
        (lambda d: arx(SampledData("flat", d.input, 0.0 * d.output, 0.1), 2, 2), "never moves"),
    ],
)
def test_bad_input_is_one_line(made, call, message):
    with pytest.raises(InputError, match=message) as caught:
        call(made(200))
    assert "\n" not in str(caught.value)
