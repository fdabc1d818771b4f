"""A drive that pushes the other way than the model says."""

from __future__ import annotations

import pytest

from idloop.estimation.direction import opposite_direction_warning
from idloop.physics import Model, load_model


def with_gain(value: float, stderr: float | None = None) -> Model:
    return load_model("dc_motor").with_values({"drive.gain": value}, {} if stderr is None else {"drive.gain": stderr})


@pytest.mark.parametrize(("value", "stderr"), [(-8.0, 0.1), (-8.0, None)])
def test_a_gain_of_the_other_sign_is_told_with_what_to_do(value, stderr):
    said = opposite_direction_warning(with_gain(8.0), with_gain(value, stderr))
    assert "drive.gain is -8 " in said
    assert "8 " in said
    assert "`scale: -1`" in said


@pytest.mark.parametrize(("value", "stderr"), [(7.0, 0.1), (0.0, 0.1), (-0.1, 0.05)])
def test_one_of_the_same_sign_or_that_may_be_is_not(value, stderr):
    assert opposite_direction_warning(with_gain(8.0), with_gain(value, stderr)) == ""


def test_a_negative_gain_of_the_model_is_none_that_turned():
    assert opposite_direction_warning(with_gain(-8.0), with_gain(-7.0)) == ""
    assert opposite_direction_warning(with_gain(-8.0), with_gain(7.0)) != ""
