"""What a node waits for is said once, after some patience."""

from __future__ import annotations

import pytest

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")

from idloop_nodes.progress import BackPressure
from idloop_nodes.streams.rates import TIMEOUT, StallNotice


def test_a_wait_is_told_once_and_anew_for_the_next():
    notice = StallNotice()
    times = [0.0, TIMEOUT - 1.0, TIMEOUT, 2.0 * TIMEOUT]
    assert [notice.due(7, now) for now in times] == [False, False, True, False]
    assert not notice.due(8, 2.0 * TIMEOUT)
    assert notice.due(8, 3.0 * TIMEOUT)


def test_nothing_to_wait_for_is_no_stall():
    notice = StallNotice()
    assert not any(notice.due(None, now) for now in (0.0, TIMEOUT, 5.0 * TIMEOUT))


def test_who_holds_a_sender_back_is_known_by_name():
    window = BackPressure(["recorder", "estimator"], window_ns=100)
    window.progress.update(500, "recorder")
    assert window.slow(300, start=0) == ["estimator"]
    assert window.slow(100, start=0) == []
