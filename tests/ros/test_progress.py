"""Back-pressure: a sender waits for its listeners."""

from __future__ import annotations

import pytest

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")

from idloop_nodes.progress import BackPressure


def test_back_pressure_waits_for_the_slowest_listener():
    gate = BackPressure(["a", "b"], window_ns=10)
    assert gate.open(10, start=0)
    assert not gate.open(11, start=0)
    gate.progress.update(5, "a")
    assert not gate.open(11, start=0)
    gate.progress.update(3, "b")
    assert gate.open(13, start=0)
    assert not gate.open(14, start=0)
    gate.progress.update(3, "b/done")
    assert gate.missing() == ["a"]
    gate.progress.update(3, "a/done")
    assert not gate.missing()


def test_back_pressure_without_listeners_is_always_open():
    assert BackPressure([], 0).open(10**18, start=0)
    assert not BackPressure([], 0).missing()
