import pytest

from idloop_nodes.streams.held_stream import EVER, PERIODS, SILENCE, CommandWait

PERIOD = 1_000_000
FAR = 10 * PERIODS * PERIOD


@pytest.mark.parametrize("lockstep", [False, True])
def test_what_has_its_command_is_settled(lockstep):
    wait = CommandWait(PERIOD, lockstep, 0.0)
    assert wait.known_until(7 * PERIOD, 8 * PERIOD, None, 0.1) == 7 * PERIOD


def test_in_real_time_a_measurement_waits_a_hundred_periods():
    wait = CommandWait(PERIOD, False, 0.0)
    assert wait.known_until(0, FAR, None, 0.1) == FAR - PERIODS * PERIOD
    assert wait.known_until(None, FAR, None, 0.1) == FAR - PERIODS * PERIOD


def test_in_lock_step_only_silence_tells_that_no_command_comes():
    wait = CommandWait(PERIOD, True, 0.0)
    assert wait.known_until(5, FAR, None, 0.9 * SILENCE) == 5
    assert wait.known_until(5, FAR, None, 1.1 * SILENCE) == FAR - PERIODS * PERIOD
    wait.update(1.1 * SILENCE)
    assert wait.known_until(5, FAR, None, 1.2 * SILENCE) == 5
    # However long the controller thinks, one step ahead of it nothing is given up.
    assert wait.known_until(FAR, FAR + PERIOD, None, 100.0 * SILENCE) == FAR


@pytest.mark.parametrize("lockstep", [False, True])
def test_after_the_end_nothing_is_waited_for(lockstep):
    wait = CommandWait(PERIOD, lockstep, 0.0)
    assert wait.known_until(FAR - 5, FAR, FAR, 0.5 * SILENCE) == FAR - 5
    assert wait.known_until(FAR - 5, FAR, FAR, 1.5 * SILENCE) == EVER
    assert wait.known_until(FAR - 5, FAR, FAR + 1, 1.5 * SILENCE) == FAR - 5
