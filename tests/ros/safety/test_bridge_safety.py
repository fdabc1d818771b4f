"""The bridge's safety without ROS: whatever comes in, what goes out is finite and within the limits."""

from __future__ import annotations

import itertools
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")

from idloop_nodes.excitation.experiment import Limits
from idloop_nodes.safety.command_limiter import CommandLimiter, CommandLimits
from idloop_nodes.safety.safety_gate import GateSettings, SafetyGate, VelocityEstimator
from idloop_nodes.streams.stream_watch import Arrival, StreamWatch

MS = 1_000_000
SECOND = 1000 * MS
EPSILON = 1e-9
ANY = st.floats() | st.sampled_from([math.nan, math.inf, -math.inf, 1.7e308, -1.7e308, 0.0])
SOME = st.floats(-5.0, 5.0) | ANY
STAMP_STEP = st.sampled_from([5 * MS, 5 * MS, 5 * MS, 0, -1 * MS, 3600 * SECOND, -3600 * SECOND])


def settings(**more):
    limits = {
        name: more.pop(name) for name in list(more) if name in CommandLimits.__dataclass_fields__ and name != "command"
    }
    return GateSettings(CommandLimits(**{"command": 2.0, "soft_start": 0.0} | limits), **more)


EFFORT = settings(
    rate=40.0,
    rms=1.0,
    rms_time=0.5,
    soft_start=0.2,
    standing=0.04,
    energy=3.0,
    motion=Limits(None, -10.0, 10.0, 50.0),
    coast_time=0.1,
)
POSITION = settings(rate=40.0, motion=Limits(None, -3.0, 4.0, None), neutral="hold_measured")

EVENTS = st.lists(
    st.one_of(
        st.tuples(st.just("measure"), STAMP_STEP, SOME, st.none() | SOME),
        st.tuples(st.just("command"), STAMP_STEP, SOME),
        st.tuples(st.just("command"), st.just(5 * MS), st.floats(-5.0, 5.0)),
        st.tuples(st.just("measure"), st.just(5 * MS), st.floats(-2.0, 2.0), st.floats(-2.0, 2.0)),
        st.tuples(st.sampled_from(["tick", "tick", "stop", "reset", "activate", "deactivate"])),
    ),
    max_size=120,
)


class Driver:
    """Plays events into a gate, 5 ms apart or as told."""

    def __init__(self, chosen, *, active=True):
        self.gate = SafetyGate(chosen)
        self.now = 10 * SECOND
        self.stamps = {"measure": 5 * SECOND, "command": 7 * SECOND}
        self.heard = {"measure": None, "command": None}
        self.sent = []
        if active:
            self.gate.activate()

    def play(self, name, *values, after=5 * MS):
        self.now += after
        output = None
        if name in self.stamps:
            step, *numbers = values
            self.stamps[name] = max(self.stamps[name] + step, 1)
            self.heard[name] = self.now
            output = getattr(self.gate, name)(self.now, self.stamps[name], *numbers)
        elif name in ("tick", "stop", "deactivate"):
            output = getattr(self.gate, name)(self.now)
        else:
            getattr(self.gate, name)()
        if output is not None:
            self.sent.append((self.now, output))
        return output

    def good(self, command=1.0, position=0.0, velocity=0.0, times=1):
        for _ in range(times):
            self.play("measure", 5 * MS, position, velocity, after=4 * MS)
            output = self.play("command", 5 * MS, command, after=MS)
        return output


@given(EVENTS, st.booleans())
def test_whatever_comes_in_an_effort_goes_out_within_the_limits(events, active):
    limits = EFFORT.command
    driver = Driver(EFFORT, active=active)
    stopped, opened, before = False, driver.now, (driver.now, 0.0)
    for event in events:
        closed, then = driver.gate.reason, driver.now
        output = driver.play(*event)
        opened = then if closed else opened
        stopped = (stopped or event[0] == "stop") and not (event[0] == "reset" and not driver.gate.latched)
        assert driver.gate.limiter.rms <= limits.rms * (1.0 + EPSILON)
        if output is None:
            continue
        assert math.isfinite(output)
        assert abs(output) <= limits.command
        assert abs(output) <= limits.command * (driver.now - opened) / SECOND / limits.soft_start
        elapsed = (driver.now - before[0]) / SECOND
        assert abs(output) <= abs(before[1]) + limits.rate * elapsed + EPSILON
        before = driver.now, output
        if output != 0.0:
            assert driver.gate.active
            assert not stopped
            assert not driver.gate.latched
            for heard in driver.heard.values():
                assert driver.now - heard <= EFFORT.watchdog * SECOND


@given(EVENTS, st.booleans())
def test_whatever_comes_in_a_position_goes_out_within_the_limits(events, active):
    driver = Driver(POSITION, active=active)
    for event in events:
        output = driver.play(*event)
        if output is not None:
            assert math.isfinite(output)
            assert POSITION.motion.position_min <= output <= POSITION.motion.position_max


@given(
    st.lists(st.tuples(st.integers(0, 40), st.floats(-1e6, 1e6), st.booleans()), max_size=200),
    st.floats(0.01, 10.0),
    st.floats(0.01, 5.0),
)
def test_the_rms_stays_within_its_limit_whatever_is_wanted(wishes, rms, rms_time):
    limiter = CommandLimiter(CommandLimits(command=50.0, rms=rms, rms_time=rms_time, soft_start=0.0, standing=0.04))
    now = SECOND
    limiter.start(now)
    for wait, wanted, obeyed in wishes:
        now += wait * MS
        limiter.sent(now, limiter.limit(now, wanted) if obeyed else 0.0)
        limiter.advance(now)
        assert limiter.rms <= rms * (1.0 + EPSILON)


def test_a_constant_wish_beyond_the_rms_is_scaled_back_to_it():
    driver = Driver(settings(rms=1.0, rms_time=0.2, standing=0.04))
    driver.good(command=2.0)
    assert driver.sent[-1][1] == pytest.approx(2.0)
    driver.good(command=2.0, times=400)
    assert driver.sent[-1][1] == pytest.approx(1.0, rel=1e-3)


def test_a_good_command_passes_as_it_is():
    driver = Driver(settings())
    assert driver.good(command=0.7) == 0.7
    assert driver.good(command=-1.3) == -1.3
    assert driver.gate.reason == ""
    assert driver.gate.limited == 0


def test_the_soft_start_opens_slowly_and_anew_after_a_stop():
    driver = Driver(settings(soft_start=1.0))
    first = [driver.good(command=2.0) for _ in range(300)]
    assert first[0] == 0.0
    assert first[100] == pytest.approx(1.0)
    assert first[250] == 2.0
    driver.play("command", 5 * MS, math.nan)
    assert driver.sent[-1][1] == 0.0
    assert driver.good(command=2.0) == 0.0


def test_a_rate_is_kept_while_a_command_stands():
    driver = Driver(settings(rate=10.0))
    driver.good(command=0.0)
    outputs = [driver.good(command=1.0), driver.play("tick"), driver.play("tick")]
    assert outputs == pytest.approx([0.05, 0.1, 0.15])


@pytest.mark.parametrize("silent", ["measure", "command"])
def test_silence_is_zero_within_the_watchdog_and_one_tick(silent):
    driver = Driver(settings())
    driver.good(command=1.0, times=3)
    last = driver.heard[silent]
    while driver.sent[-1][1] != 0.0:
        driver.play("tick", after=MS)
        if silent == "measure":
            driver.play("command", MS, 1.0, after=0)
        else:
            driver.play("measure", MS, 0.0, 0.0, after=0)
    assert driver.now - last <= 41 * MS
    assert driver.gate.reason == f"no {'measurement' if silent == 'measure' else 'command'} for 0.04 s"
    assert driver.good(command=1.0) == 1.0, "it goes on when the stream does"


def test_what_the_watchdog_found_may_stay_until_reset():
    driver = Driver(settings(latch_watchdog=True))
    driver.play("tick")
    assert not driver.gate.latched, "before the first message nothing has failed"
    driver.good(command=1.0)
    driver.play("command", 5 * MS, math.nan)
    assert driver.good(command=1.0) == 0.0
    driver.play("reset")
    assert driver.good(command=1.0) == 1.0


@pytest.mark.parametrize(
    ("event", "said"),
    [
        (("command", 5 * MS, math.nan), "the command is not finite"),
        (("command", 5 * MS, -math.inf), "the command is not finite"),
        (("command", 3600 * SECOND, 1.0), "the clock of the command jumped"),
        (("command", -3 * SECOND, 1.0), "the clock of the command jumped"),
        (("measure", 5 * MS, math.nan, 0.0), "the position is not finite"),
        (("measure", 5 * MS, 0.0, math.inf), "the velocity is not finite"),
        (("measure", 5 * MS, 1e200, 0.0), "the position is not finite"),
        (("measure", 3600 * SECOND, 0.0, 0.0), "the clock of the measurement jumped"),
        (("measure", -3600 * SECOND, 0.0, 0.0), "the clock of the measurement jumped"),
    ],
)
def test_a_bad_message_is_zero_at_once_and_the_next_good_one_passes(event, said):
    driver = Driver(settings())
    driver.good(command=1.0, times=2)
    assert driver.play(*event) == 0.0
    assert driver.gate.reason == said
    assert driver.gate.faults == 1
    assert driver.good(command=1.0) == 1.0


@pytest.mark.parametrize(
    ("state", "said"),
    [
        ({"position": 1.1}, "position 1.1 is above limit.position_max 1"),
        ({"position": -1.1}, "position -1.1 is below limit.position_min -1"),
        ({"velocity": -3.5}, "velocity -3.5 is beyond limit.velocity 3"),
        ({"position": 0.5, "velocity": 2.9}, "coasting to position 1.08 is above limit.position_max 1"),
    ],
)
def test_a_breach_stops_the_motor_until_reset_and_as_long_as_it_holds(state, said):
    driver = Driver(settings(motion=Limits(None, -1.0, 1.0, 3.0), coast_time=0.2))
    assert driver.good(command=1.0) == 1.0
    assert driver.play("measure", 5 * MS, *({"position": 0.0, "velocity": 0.0} | state).values()) == 0.0
    assert driver.gate.reason == said
    assert driver.gate.reset() == said
    assert driver.good(command=1.0) == 0.0, "back inside, but not reset"
    assert driver.gate.reset() == ""
    assert driver.good(command=1.0) == 1.0


def test_work_stops_the_motor_and_is_not_forgotten_by_a_reset():
    driver = Driver(settings(energy=0.5, energy_time=10.0))
    wanted = round(0.5 / 2.0 / 0.005)  # work / power / period
    passed = list(itertools.takewhile(bool, (driver.good(command=1.0, velocity=2.0) for _ in range(2 * wanted))))
    assert len(passed) == pytest.approx(wanted, rel=0.1)
    assert driver.gate.reason == "work is more than limit.energy 0.5"
    assert driver.gate.reset() == driver.gate.reason
    driver.good(command=1.0, times=300)
    assert driver.gate.limiter.work < 0.5
    assert driver.gate.reset() == ""


def test_the_emergency_stop_stays_through_everything_but_a_reset():
    driver = Driver(settings())
    driver.good(command=1.0)
    assert driver.play("stop") == 0.0
    driver.play("deactivate")
    driver.play("activate")
    assert driver.good(command=1.0, times=5) == 0.0
    driver.play("reset")
    assert driver.good(command=1.0) == 1.0


def test_inactive_it_says_zero_for_a_while_and_then_nothing():
    driver = Driver(settings())
    driver.good(command=1.0)
    assert driver.play("deactivate") == 0.0
    assert driver.play("command", 5 * MS, 1.0) == 0.0
    assert driver.play("tick", after=SECOND) is None
    assert driver.play("command", 5 * MS, 1.0) is None
    assert Driver(settings(), active=False).play("tick") is None


def test_a_position_holds_where_the_axis_was():
    driver = Driver(settings(neutral="hold_measured", motion=Limits(None, -5.0, 5.0, None)))
    assert driver.play("tick") is None, "nowhere is known to be"
    assert driver.good(command=3.0, position=1.5) == 3.0
    assert driver.good(command=4.5, position=1.75) == 3.75, "no farther ahead than limit.command"
    assert driver.play("stop") == 1.75
    driver.play("measure", 5 * MS, 1.0, 0.0)
    assert driver.play("tick") == 1.75, "it does not give way"


def test_a_position_may_hold_the_last_command():
    driver = Driver(settings(neutral="hold_command", motion=Limits(None, -5.0, 5.0, None)))
    assert driver.play("command", 5 * MS, 2.0) is None
    driver.good(command=3.0, position=1.5)
    assert driver.play("stop") == 3.0


def test_a_position_only_robot_has_a_velocity_too():
    driver = Driver(settings(motion=Limits(None, None, None, 3.0)))
    for step in range(20):
        driver.play("measure", 5 * MS, 0.01 * step, None)
    assert not driver.gate.latched
    for step in range(20):
        driver.play("measure", 5 * MS, 0.02 * step + 0.2, None)
    assert driver.gate.latched.startswith("velocity ")


def test_the_speedometer_needs_its_window():
    meter = VelocityEstimator(window_ns=20 * MS)
    assert [meter.take(step * 10 * MS, 0.5 * step) for step in range(2)] == pytest.approx([math.nan] * 2, nan_ok=True)
    assert meter.take(20 * MS, 1.0) == pytest.approx(50.0)
    assert meter.take(30 * MS, 2.0) == pytest.approx(75.0)


def test_one_publisher_too_many_lets_nothing_pass():
    driver = Driver(settings())
    driver.good(command=1.0)
    driver.gate.forbid("rivals", "others publish")
    assert driver.play("tick") == 0.0
    driver.gate.forbid("rivals", "")
    assert driver.good(command=1.0) == 1.0


@pytest.mark.parametrize(
    ("steps", "arrivals"),
    [
        ([5, 10, 15], "FRESH FRESH FRESH"),
        ([5, 5, 4, 6], "FRESH STALE STALE FRESH"),
        ([5, 0, 6], "FRESH FRESH FRESH"),
        ([5, 500, 505], "FRESH FRESH FRESH"),
        ([505, 500, 510], "FRESH STALE FRESH"),
        ([5, 1500, 1505], "FRESH JUMP FRESH"),
        ([1500, 5, 10], "FRESH JUMP FRESH"),
    ],
)
def test_stamps_are_compared_with_stamps(steps, arrivals):
    watch = StreamWatch(40 * MS)
    heard = [watch.update(count * MS, stamp * MS) for count, stamp in enumerate(steps)]
    assert heard == [Arrival[name] for name in arrivals.split()]


def test_after_a_silence_any_stamp_is_a_new_beginning():
    watch = StreamWatch(40 * MS)
    watch.update(0, 5 * SECOND)
    assert watch.silent(41 * MS)
    assert watch.update(50 * MS, 2 * SECOND) is Arrival.FRESH


def test_a_clock_that_stands_still_is_silence():
    watch = StreamWatch(40 * MS)
    for now in range(0, 60, 5):
        watch.update(now * MS, SECOND)
    assert watch.silent(60 * MS)
