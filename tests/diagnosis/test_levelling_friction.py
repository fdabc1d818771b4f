"""A viscous friction that grows less than in proportion to the speed, as that of grease in a harmonic drive."""

from __future__ import annotations

import math

import pytest

from idloop.diagnosis import refine
from idloop.estimation import fit
from idloop.physics import Model, load_model

from .conftest import record_of


@pytest.fixture(scope="module")
def levelling() -> Model:
    """An axis whose friction falls behind a straight line by a sixth at its usual speeds."""
    return load_model("axis").with_effects(["quadratic_drag@axis(coefficient=-0.0004)"])


def test_it_is_a_drag_below_zero(levelling: Model, start: Model) -> None:
    found = refine(start, [record_of(levelling, 1)], [record_of(levelling, 2)])
    assert found.added == ("quadratic_drag@axis",)
    assert found.model.values["quadratic_drag@axis.coefficient"] == pytest.approx(-0.0004, rel=0.1)


def test_its_interval_holds_the_truth(levelling: Model) -> None:
    model = load_model("axis").with_effects(["quadratic_drag@axis"])
    found = fit(model, [record_of(levelling, 3)])
    place = found.names.index("quadratic_drag@axis.coefficient")
    assert math.isfinite(found.stderr[place])
    assert abs(found.values[place] + 0.0004) < 4.0 * found.stderr[place]
