"""Simulated time goes by no faster than it may, also after it has been held back."""

from __future__ import annotations

import pytest

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")

from idloop_nodes.timing import SLACK, Pace


def test_an_instant_is_due_when_its_time_has_passed():
    pace = Pace(2.0)
    assert not pace.early(0.0, 100.0)
    assert pace.early(1.0, 100.4)
    assert not pace.early(1.0, 100.5)
    assert pace.early(1.1, 100.5)


def test_a_late_wake_up_is_made_up_for_and_a_long_wait_is_not():
    pace = Pace(1.0)
    assert not pace.early(0.0, 0.0)
    assert not pace.early(1.0, 1.0 + 0.5 * SLACK)
    assert not pace.early(1.0 + 0.5 * SLACK, 1.0 + 0.5 * SLACK)
    assert not pace.early(2.0, 62.0)
    assert not pace.early(2.0 + 0.9 * SLACK, 62.0)
    assert pace.early(2.0 + 1.1 * SLACK, 62.0)
    assert pace.early(10.0, 69.0)


def test_without_a_factor_nothing_is_early():
    pace = Pace(0.0)
    assert not pace.early(0.0, 0.0)
    assert not pace.early(1e6, 0.0)
