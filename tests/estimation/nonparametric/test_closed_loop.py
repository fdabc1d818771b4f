import numpy as np
import pytest

from idloop.errors import InputError
from idloop.estimation.nonparametric import indirect, welch


def test_the_reference_takes_out_the_bias_of_feedback(plant):
    direct, by_reference, inside = [], [], []
    for seed in range(25):
        data = plant.closed_loop(seed)
        estimate = indirect(data, 512)
        true = plant.response(estimate.frequency)
        by_reference.append(estimate.response[:, 0, 0] - true)
        direct.append(welch(data, 512).response[:, 0, 0] - true)
        inside.append(np.abs(by_reference[-1]) <= estimate.radius()[:, 0, 0])
    assert np.mean(np.abs(np.mean(direct, axis=0))) > 0.15
    # What averaging leaves of the scatter, and no more.
    scatter = np.std(by_reference, axis=0) / np.sqrt(len(by_reference))
    assert np.mean(np.abs(np.mean(by_reference, axis=0))) < 1.3 * np.mean(scatter)
    assert 0.92 < np.mean(inside) < 0.97


def test_direct_estimate_leans_where_theory_says(plant):
    # With u = r - y and white r of variance 1: S_yu / S_uu = (G S_rr - S_vv) / (S_rr + S_vv), both times |S|².
    data = plant.closed_loop(0, 400_000)
    estimate = welch(data, 512)
    noise = plant.disturbance_density(estimate.frequency, 0.3)
    reference = 2 * plant.sample_time
    expected = (plant.response(estimate.frequency) * reference - noise) / (reference + noise)
    assert np.median(np.abs(estimate.response[:, 0, 0] - expected)) < 0.02


def test_lines_where_the_reference_is_not_heard_are_named(plant):
    data = plant.closed_loop(1, 4096, reference=1e-3 * np.random.default_rng(3).normal(size=4096))
    assert "hardly reaches" in indirect(data, 512).notes[0]


def test_bad_input_is_one_line(plant):
    with pytest.raises(InputError, match="no reference"):
        indirect(plant.open_loop(0))
    data = plant.closed_loop(0, 1000)
    with pytest.raises(InputError, match="reference does not move"):
        indirect(plant.pack(data.input, data.output, np.zeros(1000)))
    gap = data.reference.copy()
    gap[3] = np.nan
    with pytest.raises(InputError, match="NaN"):
        indirect(plant.pack(data.input, data.output, gap))
    two = np.hstack([data.input, data.input])
    with pytest.raises(InputError, match="2 inputs"):
        indirect(type(data)("two", two, data.output, 0.01, ("a", "b"), ("V", "V"), reference=data.reference))
