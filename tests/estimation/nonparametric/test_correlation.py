import numpy as np
import pytest
from scipy import signal

from idloop.errors import InputError
from idloop.estimation.nonparametric import cra


@pytest.mark.parametrize("kind", ["white", "coloured", "binary"])
def test_bands_hold_the_true_weights(plant, kind):
    inside, silent, feedback = [], [], []
    for seed in range(100):
        estimate = cra(plant.open_loop(seed, 2000, kind=kind), 40)
        error = np.abs(estimate.response[:, 0] - plant.impulse(estimate.lag))
        inside.append(error <= estimate.band()[:, 0])
        before = estimate.lag < 0
        silent.append(np.abs(estimate.response[before, 0]) <= estimate.null_band()[0])
        feedback.append(estimate.feedback_p[0])
    assert 0.985 < np.mean(inside) < 0.999
    assert np.min(np.mean(inside, axis=0)) > 0.93
    assert 0.98 < np.mean(silent) < 0.999
    assert np.mean(np.array(feedback) < 0.01) <= 0.04


def test_error_falls_with_the_root_of_the_length(plant):
    def mean_error(samples):
        found = [cra(plant.open_loop(seed, samples), 40) for seed in range(10)]
        return np.sqrt(np.mean([(one.response[:, 0] - plant.impulse(one.lag)) ** 2 for one in found]))

    assert mean_error(2000) / mean_error(32000) == pytest.approx(4.0, rel=0.2)


def test_feedback_shows_at_negative_lags(plant):
    estimate = cra(plant.closed_loop(0), 20)
    assert estimate.feedback_p[0] < 1e-6
    assert "loop is closed" in estimate.notes[-1]
    assert cra(plant.open_loop(0), 20).notes == ()


@pytest.mark.parametrize(("hold", "lags"), [(6, 40), (25, 20)])
def test_a_held_command_in_an_open_loop_is_not_called_feedback(plant, hold, lags):
    # One that is held for longer than all lags carries the response back through the next levels.
    told = 0
    for seed in range(5):
        random = np.random.default_rng(seed)
        held = np.repeat(random.choice([-1.0, 1.0], 3000 // hold), hold)[:, None]
        late = signal.lfilter([0.0] * 5 + [0.1], [1.0, -0.9], held[:, 0])[:, None]
        output = late + 0.01 * random.normal(size=late.shape)
        said = " ".join(cra(plant.pack(held, output), lags).notes)
        assert "the input follows the output" not in said
        told += "smears" in said
    assert told > 0


def test_a_delay_is_seen(plant):
    data = plant.open_loop(2, 5000, noise=0.01)
    late = plant.pack(data.input, np.roll(data.output, 5, axis=0))
    estimate = cra(late, 20, 10)
    seen = np.abs(estimate.response[:, 0]) > estimate.null_band()[0]
    assert estimate.lag[(estimate.lag >= 0) & seen][0] == 6


def test_step_response_tends_to_the_gain(plant):
    estimate = cra(plant.open_loop(1, 200_000, noise=0.01), 60)
    assert estimate.step[-1, 0] == pytest.approx(plant.response(np.zeros(1))[0].real, rel=0.05)
    assert estimate.step.shape == (61, 1)


def test_experiments_and_outputs_go_together(plant):
    data = [plant.open_loop(seed, 1000) for seed in range(4)]
    pair = [plant.pack(one.input, one.output) for one in data]
    estimate = cra(pair, 20)
    assert estimate.samples == 4 * (1000 - 10)
    assert np.mean(estimate.stderr) < 0.6 * np.mean(cra(data[0], 20).stderr)


def test_without_prewhitening_a_coloured_input_smears_and_is_told(plant):
    data = plant.open_loop(0, 20_000)
    plain, white = cra(data, 20, 0), cra(data, 20, 10)
    true = plant.impulse(white.lag)
    assert np.max(np.abs(plain.response[:, 0] - true)) > 10 * np.max(np.abs(white.response[:, 0] - true))
    assert "smears" in plain.notes[0]


@pytest.mark.parametrize(
    ("change", "options", "message"),
    [
        (np.zeros_like, {}, "does not move"),
        (lambda u: np.sin(0.3 * np.arange(len(u)))[:, None], {}, "too few frequencies"),
        (lambda u: u, {"lags": 400}, "are needed"),
        (lambda u: u, {"lags": 0}, "are needed"),
    ],
)
def test_bad_input_is_one_line(plant, change, options, message):
    data = plant.open_loop(0, 1000)
    with pytest.raises(InputError, match=message) as caught:
        cra(plant.pack(change(data.input), data.output), **options)
    assert "\n" not in str(caught.value)


def test_against_a_plain_sum(plant):
    # One lag by its definition, without any fast transform.
    data = plant.open_loop(0, 500, kind="white")
    estimate = cra(data, 5, 0)
    u, y = (signal.detrend(v[:, 0], type="constant") for v in (data.input, data.output))
    assert estimate.response[5 + 3, 0] == pytest.approx(np.sum(y[3:] * u[:-3]) / np.sum(u * u), rel=1e-9)
    assert estimate.response[5 - 2, 0] == pytest.approx(np.sum(y[:-2] * u[2:]) / np.sum(u * u), rel=1e-9)


def test_the_result_shows_itself(plant):
    estimate = cra(plant.open_loop(0))
    axes = estimate.plot()
    assert axes.get_xlabel() == "lag [s]"
    assert axes.get_ylabel() == "weight [rad/V]"
    assert estimate.to_dict()["response"].shape == (41, 1)
    with pytest.raises(InputError, match="share"):
        estimate.band(99)


def test_the_weights_are_a_system_of_python_control(plant):
    import control

    estimate = cra(plant.open_loop(0, 2000), 20)
    found = control.impulse_response(estimate.system, np.arange(30) * estimate.sample_time).outputs.ravel()
    causal = estimate.response[estimate.lag >= 0, 0]
    # python-control's impulse has the area 1.
    np.testing.assert_allclose(found[:21] * estimate.sample_time, causal, atol=1e-12)
    np.testing.assert_allclose(found[21:], 0.0, atol=1e-12)
