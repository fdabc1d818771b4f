"""A fitted drive gain of the opposite sign."""

from __future__ import annotations

import pytest

from idloop.estimation.direction import opposite_direction_warning
from idloop.physics import Model, load_model


def with_gain(value: float, stderr: float | None = None) -> Model:
    return load_model("dc_motor").with_values({"drive.gain": value}, {} if stderr is None else {"drive.gain": stderr})


@pytest.mark.parametrize(("value", "stderr"), [(-8.0, 0.1), (-8.0, None)])
def test_a_gain_of_the_opposite_sign_gives_a_warning(value, stderr):
    warning = opposite_direction_warning(with_gain(8.0), with_gain(value, stderr))
    assert "drive.gain is -8 " in warning
    assert "8 " in warning
    assert "`scale: -1`" in warning


@pytest.mark.parametrize(("value", "stderr"), [(7.0, 0.1), (0.0, 0.1), (-0.1, 0.05)])
def test_a_gain_of_the_same_or_an_uncertain_sign_gives_none(value, stderr):
    assert opposite_direction_warning(with_gain(8.0), with_gain(value, stderr)) == ""


def test_a_negative_gain_of_the_model_gives_no_warning():
    assert opposite_direction_warning(with_gain(-8.0), with_gain(-7.0)) == ""
    assert opposite_direction_warning(with_gain(-8.0), with_gain(7.0)) != ""
