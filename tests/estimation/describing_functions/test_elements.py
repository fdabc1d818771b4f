"""Closed forms against the numeric integral, against python-control, and against what must always hold."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import control
from idloop.errors import InputError
from idloop.estimation.describing_functions import (
    DeadZone,
    FrictionBacklash,
    InertiaBacklash,
    Relay,
    Saturation,
    drive_by_sine,
)

sizes = st.floats(0.05, 20.0)
ratios = st.floats(0.05, 50.0)


@given(size=sizes, ratio=ratios)
def test_saturation_against_the_integral(size: float, ratio: float) -> None:
    element = Saturation(size)
    assert drive_by_sine(element, ratio * size, 1.0).gain == pytest.approx(
        complex(element.gain(ratio * size)), abs=2e-6
    )


@given(width=sizes, negative=sizes, ratio=ratios)
def test_dead_zone_with_two_widths_against_the_integral(width: float, negative: float, ratio: float) -> None:
    element = DeadZone(width, negative)
    found = drive_by_sine(element, ratio * width, 1.0).gain
    assert found == pytest.approx(complex(element.gain(ratio * width)), abs=1e-4)


@given(level=sizes, on=sizes, share=st.floats(-1.0, 1.0), ratio=st.floats(1.02, 50.0))
def test_relay_with_dead_zone_and_hysteresis_against_the_integral(
    level: float, on: float, share: float, ratio: float
) -> None:
    element, amplitude = Relay(level, on, share * on), ratio * on
    # A switch is found to one sample of 2048: four of them, each by half a sample.
    scale = 4.0 * level / (np.pi * amplitude)
    assert abs(drive_by_sine(element, amplitude, 1.0).gain - element.gain(amplitude)) < 3e-3 * scale


@given(gap=sizes, ratio=st.floats(0.51, 50.0))
def test_friction_backlash_against_the_integral(gap: float, ratio: float) -> None:
    element = FrictionBacklash(gap)
    assert drive_by_sine(element, ratio * gap, 1.0).gain == pytest.approx(complex(element.gain(ratio * gap)), abs=5e-6)


@given(gap=sizes, ratio=st.floats(0.4, 50.0))
def test_inertia_backlash_against_a_mass_between_walls(gap: float, ratio: float) -> None:
    element = InertiaBacklash(gap)
    assert drive_by_sine(element, ratio * gap, 1.0).gain == pytest.approx(complex(element.gain(ratio * gap)), abs=2e-4)


ELEMENTS = (
    Saturation,
    lambda c: DeadZone(c, 0.7 * c),
    lambda c: Relay(c, 0.4 * c, -0.2 * c),
    FrictionBacklash,
    InertiaBacklash,
)


@pytest.mark.parametrize("make", ELEMENTS)
@given(scale=sizes, amplitude=st.floats(0.6, 30.0))
def test_only_the_ratio_of_amplitude_and_size_counts(make, scale: float, amplitude: float) -> None:
    assert make(scale).gain(scale * amplitude) == pytest.approx(make(1.0).gain(amplitude), rel=1e-9)


@given(size=sizes, ratio=ratios)
def test_what_a_limit_cuts_off_is_what_a_dead_zone_passes(size: float, ratio: float) -> None:
    whole = Saturation(size).gain(ratio * size) + DeadZone(size).gain(ratio * size)
    assert whole == pytest.approx(1.0, abs=1e-12)


@given(gap=sizes, ratio=st.floats(0.51, 1e3))
def test_a_play_never_amplifies_and_never_leads(gap: float, ratio: float) -> None:
    gain = complex(FrictionBacklash(gap).gain(ratio * gap))
    assert abs(gain) <= 1.0
    assert gain.imag <= 0.0


def test_equation_6_1_and_6_2_as_printed() -> None:
    m, a = np.array([0.15, 0.3, 1.0, 5.0]), 0.12
    dead_zone = 1.0 - 2.0 / np.pi * (np.arcsin(a / m) + a / m * np.cos(np.arcsin(a / m)))
    assert DeadZone(a).gain(m) == pytest.approx(dead_zone)
    r = (2.0 - m / a) / (m / a)
    backlash = 0.5 * (1.0 - 2.0 / np.pi * (np.arcsin(r) + r * np.cos(np.arcsin(r))))
    assert FrictionBacklash(2.0 * a).gain(m).real == pytest.approx(backlash)


def test_relay_with_hysteresis_is_that_of_python_control() -> None:
    amplitude = np.array([0.51, 0.7, 3.0, 100.0])
    theirs = control.describing_function(control.relay_hysteresis_nonlinearity(2.0, 0.5), amplitude)
    assert Relay(2.0, 0.5, -0.5).gain(amplitude) == pytest.approx(theirs)


def test_below_the_threshold_nothing_passes() -> None:
    for element in (DeadZone(1.0), Relay(1.0, 1.0), Relay(1.0, 1.0, -1.0), FrictionBacklash(2.0)):
        assert element.gain([0.5, 0.99]) == pytest.approx([0.0, 0.0], abs=1e-15)
    assert np.isnan(InertiaBacklash(1.0).gain(0.3))


def test_inertia_backlash_at_its_smallest_amplitude_turns_by_a_quarter() -> None:
    # The whole half period is a free flight: a triangle, no first harmonic in phase.
    assert InertiaBacklash(np.pi).gain(1.0 + 1e-12) == pytest.approx(-4.0j / np.pi, abs=1e-5)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Saturation(0.0), "limit is 0"),
        (lambda: DeadZone(-1.0), "width is -1"),
        (lambda: DeadZone(1.0, float("nan")), "width_negative is nan"),
        (lambda: Relay(1.0, 0.1, 0.2), "off is 0.2; it must lie between"),
        (lambda: FrictionBacklash(float("inf")), "gap is inf"),
        (lambda: InertiaBacklash(0.0), "gap is 0"),
        (lambda: Saturation(1.0).gain([1.0, 0.0]), "amplitudes must be finite and above 0"),
        (lambda: Saturation(1.0).gain([]), "amplitudes must be finite and above 0"),
    ],
)
def test_sizes_that_make_no_sense(make, words: str) -> None:
    with pytest.raises(InputError, match=words) as caught:
        make()
    assert "\n" not in str(caught.value)
