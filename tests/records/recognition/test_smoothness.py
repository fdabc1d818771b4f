import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from idloop.records.recognition.unnamed_columns import change_by_noise, smoothest_first

WHOLE = (slice(None),)


@given(seed=st.integers(0, 200), step=st.floats(0.0, 1e-3))
def test_a_command_changes_before_its_velocity_and_that_before_its_position(seed: int, step: float) -> None:
    command = np.repeat(np.random.default_rng(seed).normal(size=40), 50)
    velocity = np.zeros(command.size)
    for k in range(1, command.size):
        velocity[k] = 0.98 * velocity[k - 1] + 0.02 * command[k - 1]
    position = np.cumsum(velocity) * 0.01
    position = np.round(position / step) * step if step > 1e-6 else position
    assert smoothest_first([(one, WHOLE) for one in (command, position, velocity)]) == [1, 2, 0]


def test_a_flicker_of_one_step_is_no_change() -> None:
    steps = np.repeat(np.arange(8.0), 20)
    steps[5::40] += 1.0
    assert change_by_noise(steps)[1] > 0.0
    assert change_by_noise(np.repeat(np.arange(8.0), 20))[1] == 0.0
