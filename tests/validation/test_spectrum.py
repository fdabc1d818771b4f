import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from idloop.validation.spectrum import by_frequency, line_powers, on_even_steps

SERIES = arrays(float, st.integers(50, 130), elements=st.floats(-1e3, 1e3, allow_subnormal=False))


@given(SERIES)
def test_lines_add_up_to_the_mean_square(values: np.ndarray) -> None:
    assert np.sum(line_powers(values)) == pytest.approx(np.mean(values**2), abs=1e-9)


@given(SERIES, st.floats(1e-3, 1e3))
def test_shares_by_band_add_up_whatever_the_unit(values: np.ndarray, scale: float) -> None:
    time = 0.01 * np.arange(len(values))
    one, two = (by_frequency(time, factor * values, np.roll(values, 1)) for factor in (1.0, scale))
    assert np.sum(one.error) == pytest.approx(1.0)
    assert np.sum(one.usual) == pytest.approx(1.0)
    np.testing.assert_allclose(one.error, two.error, atol=1e-9)
    assert np.sum(one.rms**2) == pytest.approx(np.mean(values**2), abs=1e-6)


def test_a_tone_falls_in_its_band() -> None:
    time = np.arange(0.0, 20.0, 1e-3)
    found = by_frequency(time, np.sin(2 * np.pi * 7.0 * time), np.sin(2 * np.pi * 0.7 * time))
    worst = found.worst
    assert found.edges is not None
    assert (found.edges[worst.first], found.edges[worst.last + 1]) == (5.0, 10.0)
    assert worst.text == "100 % of the error is between 5 and 10 Hz, with < 0.1 % of the measured signal's power"
    assert worst.rms == pytest.approx(np.sqrt(0.5), rel=1e-6)


def test_a_constant_error_is_in_the_lowest_band() -> None:
    time = np.arange(0.0, 10.0, 0.01)
    found = by_frequency(time, np.full(len(time), 3.0), np.sin(time))
    assert found.error[0] == pytest.approx(1.0)
    assert found.rms[0] == pytest.approx(3.0)


def test_no_motion_and_no_error_have_shares_all_the_same() -> None:
    time = np.arange(0.0, 1.0, 0.01)
    found = by_frequency(time, np.zeros(100), np.ones(100))
    assert np.sum(found.error) == pytest.approx(1.0)
    assert np.sum(found.usual) == pytest.approx(1.0)


def test_uneven_stamps_are_put_on_even_steps() -> None:
    time = np.concatenate([np.arange(0.0, 5.0, 0.01), np.arange(7.0, 12.0, 0.01)])
    step, values = on_even_steps(time, np.sin(time))
    assert step == pytest.approx(0.01)
    assert len(values) == pytest.approx(1200, abs=2)
    even = np.arange(0.0, 1.0, 0.01)
    assert on_even_steps(even, even)[1] is even
