"""Signals of real records are named joint.field, and python-control refuses dots: systems are built all the same."""

from __future__ import annotations

import numpy as np
import pytest

from idloop.estimation.black_box.sampled import SampledData
from idloop.estimation.nonparametric import welch
from idloop.estimation.polynomial import arx


@pytest.fixture(scope="module")
def data() -> SampledData:
    u = np.random.default_rng(0).normal(size=(2000, 1))
    y = np.concatenate([[0.0], u[:-1, 0]])[:, None]
    return SampledData("named", u, y, 0.01, ("motor.effort",), ("V",), ("motor.position",), ("rad",))


def test_systems_of_signals_with_dots(data: SampledData) -> None:
    model = arx(data, 1, 1)
    for system in (model.system, model.polynomials[0].system, welch(data).system):
        assert system.input_labels == ["motor_effort"]
        assert system.output_labels == ["motor_position"]
    for system in (model.noise_system, model.polynomials[0].noise_system):
        assert system.input_labels == ["e[motor_position]"]
        assert system.output_labels == ["motor_position"]
    # The model itself keeps the names of the record.
    assert model.input_names == ("motor.effort",)
