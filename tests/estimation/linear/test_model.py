import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from idloop.errors import InputError
from idloop.estimation.black_box.sampled import SampledData
from idloop.estimation.linear import LinearModel


def model(gain=((0.5,), (0.1,)), **changes):
    fields = {
        "method": "test",
        "a": np.array([[1.2, 0.3], [-0.5, 0.4]]),
        "b": np.array([[0.0], [1.0]]),
        "c": np.array([[1.0, 0.0]]),
        "d": np.array([[0.2]]),
        "gain": np.array(gain),
        "covariance": np.array([[0.01]]),
        "sample_time": 0.1,
        "input_names": ("u",),
        "input_units": ("V",),
        "output_names": ("y",),
        "output_units": ("rad",),
        "samples": 1000,
        "free": 7,
    }
    return LinearModel(**(fields | changes))


def made_by(model, samples=300, seed=1, noise=0.1, start=(0.3, -0.2)):
    rng = np.random.default_rng(seed)
    u, e = rng.normal(size=(samples, 1)), noise * rng.normal(size=(samples, 1))
    x, y = np.array(start), np.empty((samples, 1))
    for k in range(samples):
        y[k] = model.c @ x + model.d @ u[k] + e[k]
        x = model.a @ x + model.b @ u[k] + model.gain @ e[k]
    return SampledData("made", u, y, model.sample_time, ("u",), ("V",), ("y",), ("rad",)), e


def test_free_run_without_noise_is_the_data_whatever_the_first_state():
    m = model()
    data, _ = made_by(m, noise=0.0)
    np.testing.assert_allclose(m.simulate(data), data.output, atol=1e-9)
    np.testing.assert_allclose(m.simulate(data, np.array([0.3, -0.2])), data.output, atol=1e-9)
    assert np.abs(m.simulate(data, "zero") - data.output)[:5].max() > 0.01


def test_innovations_of_the_true_model_are_the_noise_that_made_the_data():
    m = model()
    data, e = made_by(m)
    # The first state is estimated from the noisy data, and forgotten by the predictor.
    np.testing.assert_allclose(m.innovations(data)[50:], e[50:], atol=1e-8)


@given(steps=st.integers(1, 12), seed=st.integers(0, 20))
def test_without_noise_every_horizon_predicts_the_data(steps, seed):
    m = model()
    data, _ = made_by(m, samples=60, seed=seed, noise=0.0)
    np.testing.assert_allclose(m.predict(data, steps), data.output, atol=1e-8)


def test_prediction_far_ahead_of_an_output_error_model_is_its_free_run():
    m = model(gain=((0.0,), (0.0,)))
    data, _ = made_by(m)
    np.testing.assert_allclose(m.predict(data, 5), m.simulate(data), atol=1e-9)


def test_horizons_share_the_one_step_recursion():
    m = model()
    data, e = made_by(m)
    two = m.predict(data, 2)[100:] + (m.c @ m.gain)[0, 0] * e[99:-1]
    np.testing.assert_allclose(two, m.predict(data, 1)[100:], atol=1e-7)


def test_frequency_response_is_that_of_the_control_system():
    m = model()
    frequency = np.array([0.1, 1.0, 3.0])
    theirs = m.system(np.exp(2j * np.pi * frequency * m.sample_time))
    np.testing.assert_allclose(m.response(frequency)[:, 0, 0], np.ravel(theirs))
    assert m.system.dt == 0.1
    assert m.system.input_labels == ["u"]


def test_final_prediction_error_and_criteria():
    m = model()
    assert m.loss == pytest.approx(0.01)
    assert m.fpe == pytest.approx(0.01 * 1.007 / 0.993)
    assert m.aic == pytest.approx(1000 * np.log(0.01) + 14)
    assert m.bic > m.aic


@pytest.mark.parametrize(
    ("changes", "message"),
    [({"sample_time": 0.2}, "sample time"), ({"output_names": ("y", "z")}, "outputs")],
)
def test_other_data_than_the_model_is_for(changes, message):
    data, _ = made_by(model())
    n = len(changes.get("output_names", ("y",)))
    other = SampledData(
        "other", data.input, np.tile(data.output, n), changes.get("sample_time", 0.1), ("u",), ("V",),
        changes.get("output_names", ("y",)), ("rad",) * n,
    )  # fmt: skip
    with pytest.raises(InputError, match=message):
        model().simulate(other)


def test_the_bode_diagram_names_units():
    magnitude, phase = model().plot()
    assert magnitude.get_ylabel() == "magnitude [rad/V]"
    assert phase.get_xlabel() == "frequency [Hz]"


def test_a_noisy_output_does_not_spoil_what_a_quiet_one_tells_of_the_first_state():
    # Both show the same integrator, one with a thousand times the noise.
    pair = model(
        gain=np.zeros((1, 2)), a=np.array([[1.0]]), b=np.array([[1.0]]), c=np.array([[1.0], [1.0]]), d=np.zeros((2, 1)),
        covariance=np.eye(2), output_names=("quiet", "loud"), output_units=("rad", "rad"),
    )  # fmt: skip
    rng = np.random.default_rng(3)
    u = rng.normal(size=(400, 1))
    motion = 0.7 + np.concatenate([[0.0], np.cumsum(u[:-1, 0])])
    noise = rng.normal(size=(400, 2)) * [1e-3, 1.0]
    data = SampledData("pair", u, motion[:, None] + noise, 0.1, ("u",), ("V",), ("quiet", "loud"), ("rad", "rad"))
    assert np.std(pair.innovations(data)[:, 0]) < 1.1e-3
    assert abs(np.mean(pair.simulate(data)[:, 0] - motion)) < 2e-4
