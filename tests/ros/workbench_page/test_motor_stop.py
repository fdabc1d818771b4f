"""The page's stop through bridge and controller: what counts as stopped, what does not, and what a reset must undo."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")
pytest.importorskip("rclpy", reason="no rclpy: run launch_scripts/test, or source a ROS 2")

from idloop.reporting.workbench.state import ERROR, FREE, RELEASING, SENT, STOPPED, Snapshot, State
from idloop_nodes.workbench_page.orders import FRESH, HEALTH_LIMIT, HOLD, ON_ITS_WAY, MotorStop


class Services:
    """Calls that a test answers itself."""

    def __init__(self):
        self.expected, self.asked = [], {}

    def expect(self, *services):
        self.expected += services

    def trigger(self, service, answered, timeout=None):
        self.asked[service] = answered


class Stand:
    """A stop with its services, its state and its time in the hands of a test."""

    def __init__(self, **options):
        self.now = 100.0
        self.services, self.page = Services(), State(Snapshot(live=True, title="motor"))
        self.started = 0
        self.motor = MotorStop(
            self.services, self.page, ["bridge", "controller"], self._start, clock=lambda: self.now, **options
        )

    def _start(self):
        self.started += 1

    def answer(self, node, service, done=True, text=""):
        self.services.asked[f"{node}/{service}"](done, text)

    @property
    def state(self):
        self.motor.poll()
        return self.page.snapshot.stop


@pytest.fixture
def stand():
    one = Stand()
    one.motor.stop()
    return one


def test_a_stop_that_was_sent_is_not_one_that_was_confirmed(stand):
    assert list(stand.services.asked) == ["bridge/emergency_stop", "controller/emergency_stop"]
    assert set(stand.services.asked) < set(stand.services.expected)
    assert stand.state == SENT


def test_stopped_is_the_word_of_the_last_node_and_a_zero(stand):
    stand.answer("bridge", "emergency_stop")
    assert stand.state == SENT, "no zero has been seen"
    stand.motor.see([-0.45, 0.0])
    assert stand.state == STOPPED
    assert stand.page.snapshot.note is None  # the page has a banner for it


def test_a_zero_without_the_word_of_the_last_node_is_no_stop(stand):
    stand.answer("controller", "emergency_stop")
    stand.motor.see([0.0])
    assert stand.state == SENT


def test_a_bridge_that_confirms_while_the_motor_is_driven_has_not_stopped_it(stand):
    stand.answer("bridge", "emergency_stop")
    stand.motor.see([0.0, -0.45])
    assert stand.state == SENT


def test_what_was_seen_before_the_stop_says_nothing():
    stand = Stand()
    stand.motor.see([0.0])
    stand.motor.stop()
    stand.answer("bridge", "emergency_stop")
    assert stand.state == SENT


@pytest.mark.parametrize(("silent", "wait"), [("command", FRESH), ("bridge", HEALTH_LIMIT)])
def test_a_bridge_that_hangs_after_it_has_confirmed_is_no_longer_believed(stand, silent, wait):
    stand.answer("bridge", "emergency_stop")
    stand.motor.see([0.0])
    assert stand.state == STOPPED
    stand.now += wait
    if silent == "command":
        stand.motor.update("bridge", "safety", "emergency stop")
    else:
        stand.motor.see([0.0])
    assert stand.state == SENT
    stand.motor.see([0.0])
    stand.motor.update("bridge", "safety", "emergency stop")
    assert stand.state == STOPPED


def test_a_position_is_held_instead_of_zero():
    stand = Stand(holds_position=True)
    stand.motor.stop()
    stand.answer("bridge", "emergency_stop")
    stand.motor.see([1.25])
    assert stand.state == SENT
    stand.now += HOLD + 0.01
    stand.motor.see([1.25])
    assert stand.state == STOPPED
    stand.motor.see([1.26])
    assert stand.state == SENT


def test_a_stop_that_nobody_confirms_is_said_to_be_none(stand):
    for node in ("bridge", "controller"):
        stand.answer(node, "emergency_stop", False, f"{node} does not answer.")
    assert stand.page.snapshot.note.level == ERROR
    assert stand.page.snapshot.note.text.startswith("THE MOTOR WAS NOT STOPPED: bridge does not answer. controller")
    assert stand.state == SENT


def stopped():
    stand = Stand()
    stand.motor.stop()
    for node in ("bridge", "controller"):
        stand.answer(node, "emergency_stop")
    stand.motor.see([0.0])
    assert stand.state == STOPPED
    return stand


def test_a_release_that_was_sent_is_not_one_that_was_confirmed():
    stand = stopped()
    stand.motor.reset()
    assert stand.state == RELEASING
    stand.answer("controller", "reset")
    assert stand.state == RELEASING, "the bridge may let it go at any time"
    stand.answer("bridge", "reset", text="soft start")
    assert stand.state == FREE
    assert stand.started == 1


@pytest.mark.parametrize("holds", ["bridge", "controller"])
def test_the_motor_is_released_when_none_holds_it(holds):
    (free,) = {"bridge", "controller"} - {holds}
    stand = stopped()
    stand.motor.reset()
    stand.answer(free, "reset")
    stand.answer(holds, "reset", False, "position is 21")
    assert stand.state == (STOPPED if holds == "bridge" else SENT), "not by the last node"
    assert stand.page.snapshot.note.text == f"{holds}: position is 21"
    assert not stand.started
    stand.motor.reset()
    stand.answer(holds, "reset")
    stand.answer(free, "reset")
    assert stand.state == FREE
    assert stand.started == 1


def test_what_somebody_else_has_stopped_and_released_is_seen():
    stand = Stand()
    stand.motor.update("bridge", "safety", "emergency stop")
    stand.motor.update("controller", "safety", "ok")
    stand.motor.update("controller", "loop", "emergency stop")
    assert stand.state == SENT
    stand.motor.see([0.0])
    assert stand.state == STOPPED
    stand.motor.update("bridge", "safety", "commands pass")
    assert stand.state == FREE


def test_health_that_was_on_its_way_does_not_take_the_stop_back():
    stand = stopped()
    stand.motor.update("bridge", "safety", "commands pass")
    assert stand.state == STOPPED
    stand.now += ON_ITS_WAY
    stand.motor.update("bridge", "safety", "commands pass")
    stand.motor.update("controller", "safety", "ok")
    assert stand.state == FREE, "somebody else has released it"


EVENTS = st.sampled_from(
    ["stop", "reset", "bridge yes", "controller yes", "both no", "zero", "drive", "emergency", "pass", "wait", "long"]
)


@given(st.lists(EVENTS, max_size=40))
def test_whatever_happens_stopped_is_never_said_over_a_driven_or_a_silent_motor(events):
    stand = Stand()
    last = None  # (value, time) of the newest command
    for event in events:
        match event:
            case "stop":
                stand.motor.stop()
                last = None
            case "reset":
                stand.motor.reset()
            case "bridge yes" | "controller yes":
                node = event.split()[0]
                for service in [one for one in stand.services.asked if one.startswith(node)]:
                    stand.services.asked.pop(service)(True, "")
            case "both no":
                for service in list(stand.services.asked):
                    stand.services.asked.pop(service)(False, "no")
            case "zero" | "drive":
                last = 0.0 if event == "zero" else 0.3, stand.now
                stand.motor.see([last[0]])
            case "emergency" | "pass":
                stand.motor.update("bridge", "safety", "emergency stop" if event == "emergency" else "commands pass")
            case _:
                stand.now += 0.2 if event == "wait" else 5.0
        if stand.state == STOPPED:
            assert last is not None
            assert last[0] == 0.0
            assert stand.now - last[1] < FRESH
