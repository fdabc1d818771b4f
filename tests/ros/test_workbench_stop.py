"""The page's stop through bridge and controller: who has confirmed it, who has not, and what a reset must undo."""

from __future__ import annotations

import pytest

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")
pytest.importorskip("rclpy", reason="no rclpy: run launch_scripts/test, or source a ROS 2")

from idloop.workbench.source import ERROR, Board, Snapshot
from idloop_nodes.workbench_stop import MotorStop


class Services:
    """Calls that a test answers itself."""

    def __init__(self):
        self.expected, self.asked = [], {}

    def expect(self, *services):
        self.expected += services

    def trigger(self, service, answered, patience=None):
        self.asked[service] = answered


@pytest.fixture
def services():
    return Services()


@pytest.fixture
def board():
    return Board(Snapshot(live=True, title="motor"))


@pytest.fixture
def motor(services, board):
    one = MotorStop(services, board, ["bridge", "controller"], lambda: services.asked.update(started=None))
    one.stop()
    return one


def test_both_are_told_and_one_that_confirms_is_enough(motor, services, board):
    assert list(services.asked) == ["bridge/emergency_stop", "controller/emergency_stop"]
    assert set(services.asked) < set(services.expected)
    services.asked["controller/emergency_stop"](False, "controller/emergency_stop does not answer.")
    assert not board.snapshot.stopped
    services.asked["bridge/emergency_stop"](True, "zero command until ~/reset")
    assert board.snapshot.stopped
    assert board.snapshot.note is None  # the page has a banner for it


def test_a_stop_that_nobody_confirms_is_said_to_be_none(motor, services, board):
    for node in ("bridge", "controller"):
        services.asked[f"{node}/emergency_stop"](False, f"{node} does not answer.")
    assert board.snapshot.note.level == ERROR
    assert board.snapshot.note.text.startswith("THE MOTOR WAS NOT STOPPED: bridge does not answer. controller")
    assert not board.snapshot.stopped


@pytest.mark.parametrize("holds", ["bridge", "controller"])
def test_the_motor_is_released_when_none_holds_it(motor, services, board, holds):
    (free,) = {"bridge", "controller"} - {holds}
    for node in ("bridge", "controller"):
        services.asked[f"{node}/emergency_stop"](True, "zero")
    motor.reset()
    services.asked[f"{free}/reset"](True, "soft start")
    services.asked[f"{holds}/reset"](False, "position is 21")
    assert board.snapshot.stopped
    assert board.snapshot.note.text == f"{holds}: position is 21"
    assert "started" not in services.asked
    motor.reset()
    services.asked[f"{holds}/reset"](True, "soft start")
    services.asked[f"{free}/reset"](True, "soft start")
    assert not board.snapshot.stopped
    assert "started" in services.asked


def test_what_somebody_else_has_stopped_is_seen(motor, board):
    motor.hear("bridge", "safety", "emergency stop")
    motor.hear("controller", "safety", "ok")
    motor.hear("controller", "loop", "emergency stop")
    assert board.snapshot.stopped
    motor.hear("bridge", "safety", "commands pass")
    assert not board.snapshot.stopped
