"""The gain of an axis is found beside friction, on even and uneven stamps, of position or velocity alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from idloop.records.inspection.response import Projection, response


@pytest.mark.parametrize("signals", [("position",), ("velocity",), ("position", "velocity")])
@pytest.mark.parametrize("seed", range(3))
def test_the_gain_lies_within_its_error(make_axis, seed, signals):
    axis = make_axis(seed)
    found = response(replace(axis, **{one: None for one in ("position", "velocity") if one not in signals}))
    assert found.certainty > 20.0
    assert abs(found.gain - 50.0) < max(5.0 * found.error, 2.5)
    assert found.share > 0.8


def test_a_constant_command_has_no_gain(make_axis):
    assert response(make_axis(command=np.ones(3000))) is None


@pytest.mark.parametrize("derivative", [0, 1, 2])
def test_projections_are_exact_for_a_parabola(derivative):
    time = 0.01 * np.arange(200)
    projection = Projection(33, 0.01)
    middle = projection.project(time)
    expected = [None, 3.0 + 10.0 * middle, np.full(middle.size, 10.0)][derivative]
    found = projection.project(2.0 + 3.0 * time + 5.0 * time**2, derivative)
    if expected is None:
        assert np.all(np.abs(found - (2.0 + 3.0 * middle + 5.0 * middle**2)) < 0.1)
    else:
        np.testing.assert_allclose(found, expected, rtol=1e-9)
