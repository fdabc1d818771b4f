import numpy as np
import pytest

from idloop.errors import InputError
from idloop.estimation.black_box.sampled import SampledData
from idloop.estimation.networks import Division, TappedDelays, TrainingRules, narx_neural, narx_wavelet


def fit(data, run):
    return 100 * (1 - np.linalg.norm(data.output - run) / np.linalg.norm(data.output - data.output.mean(axis=0)))


def test_prediction_errors_come_down_to_the_noise(plant):
    errors = []
    for seed in range(3):
        model = narx_neural(plant.narx(seed, 3000), seed=seed)
        errors.append(np.std(model.innovations(plant.narx(50 + seed))[model.first :]))
    assert np.mean(errors) == pytest.approx(0.02, rel=0.05)


@pytest.mark.slow
def test_error_falls_with_more_data(plant):
    def beyond_the_noise(samples):
        found = []
        for seed in range(4):
            model = narx_neural(plant.narx(seed, samples), seed=seed)
            clean = plant.narx(80 + seed, noise=0.0)
            found.append(np.mean(model.innovations(clean)[model.first :] ** 2))
        return np.mean(found)

    assert beyond_the_noise(4800) < 0.35 * beyond_the_noise(600)


def test_free_run_holds_on_other_data(plant):
    model, other = narx_neural(plant.narx(0)), plant.narx(9, noise=0.0)
    assert fit(other, model.simulate(other)) > 97


def test_the_parallel_form_fits_the_free_run_better(plant):
    data = plant.motor(0, 1500, noise=0.2)
    rules = TrainingRules(epochs=60)
    straight, parallel = (narx_neural(data, rules=rules, form=form) for form in ("series-parallel", "parallel"))
    other = plant.motor(5, noise=0.0)
    # White measurement noise biases the prediction one step ahead, not the free run.
    assert fit(other, parallel.simulate(other)) > fit(other, straight.simulate(other)) + 1
    assert parallel.form == "parallel"


@pytest.mark.parametrize("by", ["random", "blocks"])
def test_equal_seeds_give_equal_models(plant, by):
    data = plant.narx(0)
    one, same, other = (narx_neural(data, seed=seed, division=Division(by=by)) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one.network.weight, same.network.weight)
    np.testing.assert_array_equal(one.split.train, same.split.train)
    assert not np.array_equal(one.network.weight, other.network.weight)
    assert one.samples == one.split.train.size == len(data) - 2 - 2 * round(0.15 * (len(data) - 2))


def test_restarts_keep_the_best(plant):
    data, rules = plant.narx(0, 500), TrainingRules(epochs=20)
    alone, best = (narx_neural(data, rules=rules, restarts=n) for n in (1, 4))
    assert best.history.validation[best.history.best] <= alone.history.validation[alone.history.best]


def test_experiments_are_trained_on_together(plant):
    data = [plant.narx(0, 700), plant.narx(1, 500)]
    model = narx_neural(data)
    assert model.samples == 1196 - 2 * round(0.15 * 1196)
    assert np.std(model.innovations(plant.narx(9))[2:]) < 0.025


@pytest.mark.parametrize("estimate", [narx_neural, narx_wavelet])
def test_two_inputs_and_outputs_of_very_different_size(plant, estimate):
    random = np.random.default_rng(0)
    u = random.uniform(-1, 1, (3000, 2))
    y = np.zeros((3000, 2))
    for k in range(1, 3000):
        y[k, 0] = 0.7 * y[k - 1, 0] + np.tanh(2 * u[k - 1, 0]) + 0.2 * y[k - 1, 1]
        y[k, 1] = 0.5 * y[k - 1, 1] + u[k - 1, 1] ** 2 - 0.3 * y[k - 1, 0]
    scale_in, scale_out = np.array([1e6, 1e-6]), np.array([1e-9, 1e5])
    data = SampledData("two", u * scale_in, y * scale_out, 0.1, ("a", "b"), ("V", "V"), ("y", "z"), ("rad", "m"))
    options = {"rules": TrainingRules(epochs=40)} if estimate is narx_neural else {}
    model = estimate(data.part(0, 2000), TappedDelays(1, 1, 1), **options)
    rest = data.part(2000, 3000)
    error = np.std((rest.output - model.simulate(rest)) / scale_out, axis=0)
    assert np.all(error < 0.12 * np.std(y, axis=0))


def test_offsets_do_no_harm(plant):
    data = plant.narx(0)
    moved = plant.pack(data.input + 1e4, data.output - 1e5)
    one, other = narx_neural(data), narx_neural(moved)
    np.testing.assert_allclose(other.simulate(moved) + 1e5, one.simulate(data), atol=2e-3)


def test_repeated_and_constant_inputs_do_no_harm(plant):
    data = plant.narx(0)
    u = np.hstack([data.input, 2 * data.input, np.full_like(data.input, 3.0)])
    same = SampledData("same", u, data.output, data.sample_time, ("a", "b", "c"), ("V", "V", "V"))
    for model in (narx_neural(same), narx_wavelet(same)):
        assert np.std(model.innovations(same)[2:]) < 0.05


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"hidden": 0}, "hidden units"),
        ({"restarts": 0}, "starts"),
        ({"form": "cyclic"}, "cyclic"),
        ({"delays": TappedDelays(0, 0)}, "all zero"),
        ({"delays": TappedDelays((1, 1), 1)}, "na = "),
        ({"delays": TappedDelays(400, 1)}, "do not fill"),
        ({"hidden": 100}, "training samples for a network"),
    ],
)
def test_bad_input_is_one_line(plant, options, message):
    with pytest.raises(InputError, match=message) as caught:
        narx_neural(plant.narx(0, 300), **options)
    assert "\n" not in str(caught.value)


def test_data_that_tells_nothing(plant):
    data = plant.narx(0, 300)
    with pytest.raises(InputError, match="y does not move"):
        narx_neural(plant.pack(data.input, np.full(300, 2.0)))
    with pytest.raises(InputError, match="no data"):
        narx_neural([])
    with pytest.raises(InputError, match="negative"):
        TappedDelays(-1, 2)
