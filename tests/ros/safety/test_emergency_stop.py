"""The services that stop a motor and let it go, without ROS around them."""

from __future__ import annotations

import threading
from types import SimpleNamespace

import pytest

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")
pytest.importorskip("std_srvs", reason="no rclpy: run launch_scripts/test, or source a ROS 2")

from idloop_nodes.managed_node import STOPPED, EmergencyStop


class Node:
    """Remembers the services, and what was logged."""

    def __init__(self):
        self.services, self.said = {}, []

    def create_service(self, kind, name, callback):
        self.services[name] = callback

    def get_logger(self):
        return SimpleNamespace(warning=self.said.append)


class Stand:
    def __init__(self, refusal=""):
        self.node, self.lock, self.calls, self.refusal = Node(), threading.Lock(), [], refusal
        self.stop = EmergencyStop(self.node, self.lock, self._stop, self._reset, "soft start")

    def _stop(self):
        assert self.lock.locked()
        self.calls.append("stop")

    def _reset(self):
        assert self.lock.locked()
        self.calls.append("reset")
        return self.refusal

    def call(self, name):
        response = self.node.services[name](None, SimpleNamespace(success=None, message=None))
        assert not self.lock.locked()
        return response.success, response.message


def test_it_offers_both_services_and_starts_free():
    one = Stand()
    assert set(one.node.services) == {"~/emergency_stop", "~/reset"}
    assert one.stop.latched == ""
    assert one.calls == []


def test_a_stop_is_latched_confirmed_and_said():
    one = Stand()
    assert one.call("~/emergency_stop") == (True, STOPPED)
    assert one.stop.latched == "emergency stop"
    assert one.calls == ["stop"]
    assert one.node.said == [f"emergency stop: {STOPPED}"]


def test_a_reset_lets_go_and_says_what_follows():
    one = Stand()
    one.call("~/emergency_stop")
    assert one.call("~/reset") == (True, "soft start")
    assert one.stop.latched == ""
    assert one.calls == ["stop", "reset"]


def test_a_reset_that_is_refused_keeps_the_stop_and_says_why():
    one = Stand(refusal="position is 21")
    one.call("~/emergency_stop")
    assert one.call("~/reset") == (False, "position is 21")
    assert one.stop.latched == "emergency stop"
