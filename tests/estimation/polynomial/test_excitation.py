"""Commands that are too poor for the coefficients that are asked of them."""

import numpy as np
import pytest

from idloop.estimation.black_box.identification import identify
from idloop.estimation.black_box.method import Choices
from idloop.estimation.black_box.sampled import SampledData
from idloop.estimation.polynomial.model import excited_order

TIME = np.arange(2000) * 0.01
WAVE = np.sin(2.0 * np.pi * 2.0 * TIME)


def record(command, seed=0):
    lag = 0.1 * np.convolve(command, 0.9 ** np.arange(100))[: len(command)]
    output = lag + 0.01 * np.random.default_rng(seed).normal(size=len(command))
    return SampledData("record", command[:, None], output[:, None], 0.01)


@pytest.mark.parametrize(
    ("command", "order"),
    [
        (np.zeros(2000), 0),
        (np.ones(2000), 1),
        (WAVE, 2),
        (WAVE + 0.3, 3),
        (WAVE + np.cos(2.0 * np.pi * 5.0 * TIME), 4),
        # A single step, a command that is noisy, and one of which the beginning tells nothing.
        (np.where(TIME > 1.0, 1.0, 0.0), 8),
        (WAVE + 1e-6 * np.random.default_rng(0).normal(size=2000), 8),
        (np.concatenate([np.ones(30_000), np.random.default_rng(0).normal(size=500)]), 8),
    ],
)
def test_a_command_excites_as_many_coefficients_as_it_has_directions(command, order):
    assert excited_order([command], 8) == order
    assert excited_order([command, command], 8) == order


def test_two_experiments_together_excite_more():
    assert excited_order([WAVE, np.cos(2.0 * np.pi * 5.0 * TIME)], 8) == 4


@pytest.mark.parametrize("name", ["oe", "bj", "iv4", "roe"])
def test_a_single_sine_is_told_where_more_is_asked_of_it(name):
    (note,) = [one for one in identify(record(WAVE), name, Choices(order=2)).model.notes if "persistently" in one]
    assert note.startswith(
        "input is persistently exciting of order 2 only, as a single sine is, and its polynomials need 4"
    )
    for quiet, order in ((record(WAVE), 1), (record(np.random.default_rng(1).normal(size=2000)), 2)):
        assert not any("persistently" in one for one in identify(quiet, name, Choices(order=order)).model.notes)


@pytest.mark.parametrize("name", ["arx", "rarx", "rarmax", "kalman"])
def test_a_constant_command_is_told(name):
    notes = identify(record(np.ones(2000)), name, Choices(order=2)).model.notes
    assert any("persistently exciting of order 1 only, as a constant is" in one for one in notes)
    # Noise at the output excites A.
    assert not any("persistently" in one for one in identify(record(WAVE), name, Choices(order=2)).model.notes)
