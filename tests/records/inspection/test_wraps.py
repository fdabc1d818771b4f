"""Jumps by the range of an encoder are found with their size; other jumps are not wraps."""

from __future__ import annotations

import numpy as np
import pytest

from idloop.records.inspection.wraps import find_wraps


@pytest.mark.parametrize(
    "position",
    [np.ones(100), np.arange(5.0), np.sin(np.arange(300) / 10), np.arange(100) // 50 + 0.001 * np.arange(100)],
)
def test_no_wrap(position):
    assert find_wraps(position) is None


@pytest.mark.parametrize("speed", [0.1, -0.3])
def test_a_wrap_is_undone(speed):
    straight = 1.0 + speed * np.arange(300)
    found = find_wraps(np.mod(straight, 7.0))
    assert found.span == pytest.approx(7.0, rel=1e-6)
    np.testing.assert_allclose(np.diff(found.unwrapped), speed, rtol=1e-6)
