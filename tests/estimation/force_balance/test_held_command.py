"""A held command around the instants of a measurement: exact means and exact sides of jumps."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from idloop.estimation.force_balance.held_command import CommandAround, HeldCommand, held_along

STEP = 0.01


def levels(count: int) -> tuple[np.ndarray, np.ndarray, HeldCommand]:
    time = STEP * np.arange(count)
    value = np.where(np.arange(count) // 5 % 2 == 0, 1.0, -1.0)
    return time, value, HeldCommand(time, value, float(time[-1]))


@settings(deadline=None, max_examples=50)
@given(shift=st.floats(-0.9, 1.9))
def test_the_two_sides_of_a_jump_have_the_mean(shift: float) -> None:
    time, _, held = levels(60)
    around = held.around(time - shift * STEP, STEP)
    mixed = (1.0 - around.late) * around.before + around.late * around.after
    np.testing.assert_allclose(mixed, around.mean[around.jumps], atol=1e-9)
    elsewhere = np.setdiff1d(np.arange(5, 55), around.jumps)
    np.testing.assert_allclose(np.abs(around.mean[elsewhere]), 1.0, atol=1e-9)


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
    around = HeldCommand(time, np.sin(2.0 * np.pi * time), float(time[-1])).around(time[1:], STEP)
    assert len(around.jumps) == 0


def test_before_the_first_command_it_is_zero() -> None:
    around = HeldCommand(np.array([1.0]), np.array([2.0]), 3.0).around(np.array([0.5, 1.0, 2.0]), STEP)
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
