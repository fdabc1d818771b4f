"""A command's numbers against signals whose numbers are known."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from idloop.records.inspection.excitation import analyse_command, power_spectrum

TIME = np.arange(8000) / 1000


@given(amplitude=st.floats(0.01, 100.0), offset=st.floats(-10.0, 10.0))
def test_sine(amplitude, offset):
    found = analyse_command(TIME, offset + amplitude * np.sin(2 * np.pi * 5 * TIME))
    assert found.crest_factor == pytest.approx(np.sqrt(2), rel=1e-3)
    assert found.mean == pytest.approx(offset, abs=1e-9 + 1e-6 * amplitude)
    assert found.band_hz == pytest.approx((5.0, 5.0), abs=0.13)
    assert found.levels == 65


def test_square_has_two_levels_and_sits_at_its_limits():
    found = analyse_command(TIME, np.where(np.sin(2 * np.pi * TIME + 0.1) > 0, 2.0, -2.0))
    assert (found.levels, found.sign_changes, found.changes) == (2, 16, 16)
    assert found.crest_factor == pytest.approx(1.0, rel=1e-3)
    assert found.limit_share == pytest.approx(1.0)


def test_no_command_is_no_limit():
    found = analyse_command(TIME, np.where(np.sin(2 * np.pi * TIME + 0.1) > 0, 2.0 * TIME / TIME[-1], 0.0))
    assert found.zero_share == pytest.approx(0.5, abs=0.05)
    assert found.limit_share < 0.01


def test_a_command_counts_for_as_long_as_it_is_held():
    found = analyse_command(np.array([0.0, 1.0, 4.0, 5.0]), np.array([1.0, 0.0, 1.0, 0.0]))
    assert found.zero_share == pytest.approx(4 / 6)
    assert found.mean == pytest.approx(2 / 6)


def test_constant():
    found = analyse_command(TIME, np.full(TIME.size, 0.3))
    assert (found.levels, found.rms) == (1, pytest.approx(0.0, abs=1e-12))
    assert np.isnan(found.crest_factor)
    assert found.band_hz == (0.0, 0.0)


def test_spectrum_holds_all_of_the_power():
    frequency, power = power_spectrum(TIME, np.random.default_rng(0).normal(size=TIME.size))
    assert power.sum() == pytest.approx(1.0)
    assert frequency[-1] == pytest.approx(500.0)
