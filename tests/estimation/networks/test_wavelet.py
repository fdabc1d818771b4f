import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from idloop.errors import InputError
from idloop.estimation.networks import Division, TappedDelays, TrainingRules, narx_wavelet
from idloop.estimation.networks.network import SCALING, WAVELET
from idloop.estimation.networks.wavelet import dyadic_grid, select


def fit(data, run):
    return 100 * (1 - np.linalg.norm(data.output - run) / np.linalg.norm(data.output - data.output.mean(axis=0)))


@given(seed=st.integers(0, 30), outputs=st.integers(1, 3))
def test_selection_is_the_greedy_search(seed, outputs):
    random = np.random.default_rng(seed)
    base, targets = random.normal(size=(60, 2)), random.normal(size=(60, outputs))
    candidates = random.normal(size=(60, 8)) + base[:, :1]
    chosen: list[int] = []
    for _ in range(4):
        left = {}
        for one in set(range(8)) - set(chosen):
            columns = np.hstack([base, candidates[:, [*chosen, one]]])
            left[one] = np.sum((targets - columns @ np.linalg.lstsq(columns, targets, rcond=None)[0]) ** 2)
        chosen.append(min(left, key=left.get))
    assert select(base, candidates.copy(), targets, 4).tolist() == chosen


def test_dependent_candidates_are_left_alone():
    random = np.random.default_rng(0)
    base = random.normal(size=(50, 2))
    one = random.normal(size=(50, 1))
    candidates = np.hstack([one, 3 * one, base @ np.ones((2, 1)), one + base[:, :1]])
    assert len(select(base, candidates, random.normal(size=(50, 1)), 4)) == 1


@given(seed=st.integers(0, 20), dimension=st.integers(1, 4))
def test_the_grid_is_dyadic_and_where_the_data_is(seed, dimension):
    z = np.random.default_rng(seed).normal(size=(500, dimension))
    kind, center, dilation = dyadic_grid(z, 3, 50)
    coarse = dilation.min()
    level = np.log2(dilation / coarse)
    np.testing.assert_allclose(level, np.rint(level), atol=1e-12)
    np.testing.assert_allclose(center * dilation[:, None], np.rint(center * dilation[:, None]), atol=1e-9)
    assert np.all(level[kind == SCALING] == 0)
    assert set(kind) == {SCALING, WAVELET}
    for one, size in zip(center, dilation, strict=True):
        assert np.sum(np.all(np.abs(z - one) * size <= 0.5 + 1e-9, axis=1)) > dimension


def test_a_linear_plant_is_its_linear_part(plant):
    found = []
    for seed in range(10):
        model = narx_wavelet(plant.linear(seed, 4000), units=1)
        net = model.network
        found.append(net.linear[0] * net.output_width / net.width)
    np.testing.assert_allclose(np.mean(found, axis=0), [1.5, -0.7, 1.0, 0.5], atol=0.01)


def test_free_run_beyond_the_linear_model(plant):
    data, other = plant.motor(0), plant.motor(1, noise=0.0)
    model = narx_wavelet(data)
    linear = narx_wavelet(data, units=1)
    assert model.units == 25
    assert fit(other, model.simulate(other)) > 95
    assert fit(other, linear.simulate(other)) < 90


@pytest.mark.slow
def test_prediction_errors_come_near_the_noise(plant):
    error = [np.std(narx_wavelet(plant.narx(0, 6000), units=n).innovations(plant.narx(9))[2:]) for n in (1, 25, 60)]
    assert error[0] > 0.05
    assert error[1] < 0.025
    assert error[2] < 0.0225


def test_refinement_lowers_the_error(plant):
    data, other = plant.motor(0), plant.motor(1, noise=0.0)
    division = Division(0.8, 0.2, 0.0)
    plain = narx_wavelet(data, units=12, division=division)
    refined = narx_wavelet(data, units=12, division=division, refine=TrainingRules(epochs=30))
    parallel = narx_wavelet(data, units=12, division=division, refine=TrainingRules(epochs=15), form="parallel")
    errors = [np.std(model.innovations(other)[2:]) for model in (plain, refined)]
    assert errors[1] < 0.8 * errors[0]
    assert refined.history.step == "epoch"
    runs = [np.std(other.output - model.simulate(other)) for model in (refined, parallel)]
    assert runs[1] < 1.05 * runs[0]


def test_the_history_is_that_of_each_number_of_units(plant):
    data = plant.narx(0, 1500)
    division = Division(0.6, 0.2, 0.2)
    long = narx_wavelet(data, units=12, division=division)
    short = narx_wavelet(data, units=5, division=division)
    history = long.history
    assert history.step == "unit"
    assert np.all(np.diff(history.train) <= 1e-12)
    # The fifth unit is chosen alike whatever follows.
    np.testing.assert_allclose(history.train[:6], short.history.train, rtol=1e-6)
    rows = data.output[2:] - short.predict(data)[2:]
    scaled = (rows / short.network.output_width)[short.split.validation, 0]
    assert np.mean(scaled**2) == pytest.approx(history.validation[5], rel=1e-6)


def test_the_number_of_units_chosen_by_itself(plant):
    few = narx_wavelet(plant.linear(0, 3000), units="auto")
    many = narx_wavelet(plant.motor(0), units="auto")
    assert few.units <= 2
    assert many.units > 15
    assert few.history.stop == "generalised cross-validation"
    held_out = narx_wavelet(plant.motor(0), units="auto", division=Division(0.7, 0.3, 0.0))
    assert held_out.history.stop == "validation"
    assert held_out.units == held_out.history.best == np.argmin(held_out.history.validation)


def test_far_from_the_data_only_the_linear_part_is_left(plant):
    data = plant.narx(0)
    model = narx_wavelet(data)
    far = plant.pack(data.input[:3] * 0 + 100.0, data.output[:3] * 0)
    net = model.network
    z = (np.array([0.0, 0.0, 100.0, 100.0]) - net.center) / net.width
    expected = net.output_center + net.output_width * (net.constant + net.linear @ z)
    assert model.predict(far)[2] == pytest.approx(expected)


def test_more_rows_than_selection_looks_at(plant):
    model = narx_wavelet(plant.narx(0, 30_000), units=10)
    assert model.samples == 29_998
    assert np.std(model.innovations(plant.narx(9))[2:]) < 0.035


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"units": 0}, "0 units"),
        ({"form": "parallel"}, "refine"),
        ({"form": "cyclic"}, "cyclic"),
        ({"units": 500}, "training samples"),
        ({"delays": TappedDelays(100, 100), "units": "auto"}, "training samples"),
        ({"delays": TappedDelays(1, (1, 1))}, "nb = "),
    ],
)
def test_bad_input_is_one_line(plant, options, message):
    with pytest.raises(InputError, match=message) as caught:
        narx_wavelet(plant.narx(0, 300), **options)
    assert "\n" not in str(caught.value)
