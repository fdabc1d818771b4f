"""Units and signs by the slope of the position, wraps and unsigned numbers."""

from __future__ import annotations

from math import pi
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter

from idloop.records.recognition.recognise import recognise_table
from idloop.records.recognition.signal_units import (
    decoded,
    find_decoding,
    find_wrap,
    motion_units,
    slope_of,
    steps_per_turn,
)
from idloop.records.tables.mapping import SignBit
from idloop.records.tables.table import Table

T = np.arange(4000) * 0.005
ANGLE = 3.0 * np.sin(2.0 * T) + np.sin(7.0 * T)
SPEED = 6.0 * np.cos(2.0 * T) + 7.0 * np.cos(7.0 * T)
PLACES = {"rad": 1.0, "deg": 180.0 / pi, "rev": 0.5 / pi}
SPEEDS = {"rad/s": 1.0, "rpm": 30.0 / pi, "deg/s": 180.0 / pi, "rev/s": 0.5 / pi}


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("speed", SPEEDS)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_one_unit_that_is_known_tells_the_other(place, speed, sign):
    position, velocity = ANGLE * PLACES[place], sign * SPEED * SPEEDS[speed]
    for units in ((place, ""), ("", speed), (place, speed)):
        found = motion_units(T, position, velocity, units, ("s",), linear=False)
        assert found.agree
        # Degrees with degrees per second are as good as radians with radians per second.
        assert (found.position, found.velocity) == (place, speed)
        assert found.slope == pytest.approx(sign, abs=0.02)


def test_time_in_microseconds_is_told_by_the_velocity():
    found = motion_units(T, ANGLE, SPEED * 1e3, ("rad", "rad/s"), ("ms", "us"), linear=False)
    assert (found.time, found.agree) == ("us", True)


def test_another_signal_is_no_velocity():
    assert not motion_units(
        T, ANGLE, np.random.default_rng(1).normal(size=T.size), ("rad", ""), ("s",), linear=False
    ).agree


@pytest.mark.parametrize(("whole", "unit"), [(2 * pi, "rad"), (360.0, "deg"), (4096.0, "counts"), (65536.0, "counts")])
def test_wraps(whole, unit):
    wrapped = np.mod(ANGLE * whole / 3.0, whole)
    assert find_wrap(wrapped, unit) == pytest.approx(whole)
    assert find_wrap(wrapped - whole / 2, unit) == pytest.approx(whole)
    assert find_wrap(ANGLE * whole / 3.0, unit) == 0.0


def test_unsigned_numbers():
    signed = np.round(300 * np.sin(T))
    assert find_decoding(np.mod(signed, 65536)) == "int16"
    assert find_decoding(np.mod(signed, 2.0**32)) == "int32"
    assert find_decoding(signed) is None
    assert find_decoding(np.abs(signed)) is None
    assert find_decoding(np.abs(signed) * 200.0) is None, "a signal that takes all values is no unsigned one"


@pytest.mark.parametrize("bit", [10, 11, 15])
def test_a_sign_bit_above_the_magnitude(bit):
    """As servos send their speed and load."""
    signed = np.round(450 * np.sin(T) + np.random.default_rng(bit).normal(size=T.size) * 8)
    raw = np.where(signed < 0, 2**bit - signed, signed)
    found = find_decoding(raw)
    assert found == SignBit(sign_bit=bit)
    np.testing.assert_array_equal(decoded(raw, found), signed)


@pytest.mark.parametrize(
    "value",
    [
        pytest.param(np.round(2048 + 900 * np.sin(T)), id="a position that passes a power of two"),
        pytest.param(np.mod(np.round(3000 * T), 4096.0), id="an encoder that starts again"),
        pytest.param(np.where(np.sin(T) > 0, 1100.0, 100.0), id="a command of two levels"),
        pytest.param(100.0 + 200 * np.floor(4 + 4 * np.sin(T)), id="a command of several levels"),
        pytest.param(np.random.default_rng(1).integers(0, 4096, T.size).astype(float), id="noise over the range"),
        pytest.param(
            np.where(np.sin(T) > 0, 1100.0, 100.0) + np.random.default_rng(2).integers(0, 40, T.size),
            id="a measured current that is switched",
        ),
    ],
)
def test_what_was_unsigned_has_no_sign_bit(value):
    assert find_decoding(value) is None


def test_the_slope_is_found_over_runs_of_which_some_show_nothing():
    runs = [slice(0, 1500), slice(1500, 1510), slice(1510, 2000), slice(2000, 4000)]
    time = np.concatenate([T[run] - T[run.start] for run in runs])
    rate = np.where((time > 0) & (np.arange(T.size) // 500 != 3), SPEED, np.nan)
    found = slope_of(time, ANGLE, rate, runs)
    assert found is not None
    assert found.value == pytest.approx(1.0, abs=0.01)
    assert slope_of(time, np.full(T.size, np.nan), rate, runs) is None


@pytest.mark.parametrize("largest", [0.1, 0.3, 0.4])
def test_a_position_that_goes_round_by_large_steps(largest):
    """Its largest step between two samples is this part of a turn."""
    time = np.arange(600) / 50.0
    speed = largest * 360.0 * np.sin(0.9 * time)
    assert find_wrap(np.cumsum(speed) % 360.0, "deg") == 360.0


@pytest.mark.parametrize("seed", range(5))
def test_a_noisy_angle_of_large_steps_does_not_go_round(seed):
    assert find_wrap(np.random.default_rng(seed).uniform(0.0, 360.0, size=600), "deg") == 0.0


@pytest.mark.parametrize(("unit", "turn"), [("rad", 2 * np.pi), ("deg", 360.0)])
def test_the_steps_of_an_angle_are_those_of_an_encoder(unit, turn):
    angle = 0.1 * turn * np.sin(np.arange(500) / 40.0)
    for counts in (1024, 4096):
        assert steps_per_turn(np.round(angle * counts / turn) * turn / counts, unit) == counts
    # Decimals, noise and the speed of an encoder have other steps.
    for other in (np.round(angle, 2), angle, np.round(angle * 1024 / turn) * turn / 1024 / 0.003):
        assert steps_per_turn(other, unit) == 0
    # From -1 to 1 in 12 bits, of which 737,100 are within the accuracy of 360.
    assert steps_per_turn(np.round(0.5 * angle / turn * 20475) * 2.0 / 4095, unit) == 0


def test_what_follows_a_set_point_in_the_steps_of_an_encoder_is_no_velocity():
    time, step = np.arange(2000) / 500.0, 2 * np.pi / 1024
    wanted = np.where(time % 2.0 < 1.0, 0.5, -0.5)
    place = np.round(lfilter([0.05], [1.0, -0.95], wanted) / step) * step
    found = recognise_table(Table(Path("log.csv"), {"0": time, "1": wanted, "2": place}))
    assert found.of("velocity") is None
    assert (found.of("position").column, found.of("position").unit) == ("2", "rad")
    assert "1024 of its steps" in found.of("position").reason


def test_slope_of_tests_that_begin_again_at_one_place():
    time = np.arange(200) * 0.005
    way = [0.3 * (1.0 - np.cos(k * time)) for k in (2.0, 3.0, 5.0, 4.0)]
    speed = [0.3 * k * np.sin(k * time) for k in (2.0, 3.0, 5.0, 4.0)]
    # No stamp falls: the tests follow each other in one file, with a pause or without one.
    for pause in (0.0, 10.0):
        stamps = np.concatenate([k * (1.0 + pause) + time for k in range(4)])
        found = slope_of(stamps, np.concatenate(way), 4.0 * np.concatenate(speed))
        assert found is not None
        assert found.value == pytest.approx(4.0, rel=0.02)
        assert found.correlation > 0.99
