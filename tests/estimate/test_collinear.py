"""Signals that are combinations of each other."""

import numpy as np
import pytest

from idloop.errors import InputError
from idloop.estimate.collinear import move_together
from idloop.estimate.identification import identify
from idloop.estimate.sampled import SampledData


@pytest.mark.parametrize("factor", [2.0, -3.0, 1e-9])
def test_outputs_of_one_signal_are_refused(factor: float) -> None:
    random = np.random.default_rng(0)
    command = random.normal(size=(500, 1))
    one = np.cumsum(command, axis=0) + 0.1 * random.normal(size=(500, 1))
    data = SampledData(
        name="twice", input=command, output=np.hstack([one, factor * one]),
        sample_time=0.01, input_names=("u",), input_units=("V",), output_names=("y", "z"), output_units=("rad", "rad"),
    )  # fmt: skip
    for method in ("arx", "n4sid"):
        with pytest.raises(InputError, match=r"y, z move together.*--output"):
            identify(data, method)


def test_one_signal_or_noise_beside_it_moves_by_itself() -> None:
    one = np.random.default_rng(0).normal(size=(500, 1))
    assert not move_together(one)
    assert not move_together(np.hstack([one, np.zeros((500, 1))]))
    assert not move_together(np.hstack([one, 2.0 * one + 1e-6 * np.random.default_rng(1).normal(size=(500, 1))]))
    assert move_together(np.hstack([one, 2.0 * one]))
