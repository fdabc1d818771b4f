"""A held command around the instants of a measurement: exact means and exact sides of jumps."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from idloop.estimation.force_balance.held_command import CommandAround, HeldCommand, Weight, held_along

STEP = 0.01


def levels(count: int) -> tuple[np.ndarray, np.ndarray, HeldCommand]:
    time = STEP * np.arange(count)
    value = np.where(np.arange(count) // 5 % 2 == 0, 1.0, -1.0)
    return time, value, HeldCommand(time, value)


@settings(deadline=None, max_examples=50)
@given(shift=st.floats(-0.9, 1.9))
def test_the_two_sides_of_a_jump_have_the_mean(shift: float) -> None:
    time, _, held = levels(60)
    around = held.around(time - shift * STEP, STEP)
    mixed = (1.0 - around.late) * around.before + around.late * around.after
    np.testing.assert_allclose(mixed, around.mean[around.jumps], atol=1e-9)


@settings(deadline=None, max_examples=50)
@given(shift=st.integers(0, 300).map(lambda percent: percent / 100.0), seed=st.integers(0, 99))
def test_a_mass_moves_from_sample_to_sample_by_the_means(shift: float, seed: int) -> None:
    value = np.random.default_rng(seed).normal(size=40)
    time, held = STEP * np.arange(40), HeldCommand(STEP * np.arange(40), value)
    # The motion of a unit mass, exact at instants that contain every sample and every jump.
    instants = np.unique(np.round(np.concatenate([time, time + shift * STEP]), 12))
    acting = np.where(instants >= shift * STEP - 1e-9, value[np.maximum(np.searchsorted(
        time + shift * STEP, instants + 1e-9) - 1, 0)], 0.0)  # fmt: skip
    length = np.diff(instants)
    speed = np.concatenate([[0.0], np.cumsum(acting[:-1] * length)])
    place = np.concatenate([[0.0], np.cumsum(speed[:-1] * length + 0.5 * acting[:-1] * length**2)])
    at = np.searchsorted(instants, time - 1e-9)
    v, q, inner = speed[at], place[at], time[1:-1] - shift * STEP
    by_speed, by_place = (held.around(inner, STEP, weight).mean for weight in (Weight.VELOCITY, Weight.POSITION))
    np.testing.assert_allclose(by_speed, (v[2:] - v[:-2]) / (2.0 * STEP), atol=1e-8)
    np.testing.assert_allclose(by_place, (q[2:] - 2.0 * q[1:-1] + q[:-2]) / STEP**2, atol=1e-6)


@pytest.mark.parametrize(("shift", "late"), [(0.0, 0.5), (0.25, 0.25), (-0.25, 0.75)])
def test_a_command_that_acts_later_has_less_of_the_sample_after_the_jump(shift: float, late: float) -> None:
    time, _, held = levels(60)
    around = held.around(time - shift * STEP, STEP)
    at = np.flatnonzero(around.jumps == 10)
    assert around.before[at] == -1.0
    assert around.after[at] == 1.0
    np.testing.assert_allclose(around.late[at], late, atol=1e-9)


def test_a_smooth_command_does_not_jump() -> None:
    time = STEP * np.arange(500)
    around = HeldCommand(time, np.sin(2.0 * np.pi * time)).around(time[1:], STEP)
    assert len(around.jumps) == 0


def test_before_the_first_command_it_is_zero() -> None:
    around = HeldCommand(np.array([1.0]), np.array([2.0])).around(np.array([0.5, 1.0, 2.0]), STEP)
    np.testing.assert_allclose(around.mean, [0.0, 1.0, 2.0], atol=1e-9)


def test_joined_commands_keep_their_jumps() -> None:
    time, _, held = levels(60)
    one = held.around(time, STEP)
    both = CommandAround.joined([one, one])
    np.testing.assert_array_equal(both.jumps, np.concatenate([one.jumps, one.jumps + 60]))
    np.testing.assert_allclose(both.mean, np.tile(one.mean, 2))
    mixed = (1.0 - both.late) * both.before + both.late * both.after
    np.testing.assert_allclose(mixed, both.mean[both.jumps], atol=1e-9)


def test_a_measured_signal_is_held_on_the_curve_through_its_samples() -> None:
    def curve(t: np.ndarray) -> np.ndarray:
        return 3.0 * t**3 - t

    time = np.arange(0.0, 1.0, 0.1)
    stamps, value = held_along(time, curve(time))
    assert np.all(np.diff(stamps) > 0.0)
    middle = 0.5 * (stamps[1:] + stamps[:-1])
    np.testing.assert_allclose(value[:-1], curve(middle), atol=1e-12)
    few = held_along(time[:3], time[:3])
    np.testing.assert_array_equal(few[0], time[:3])
