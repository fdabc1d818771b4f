"""Which of two nodes of one name came second."""

from __future__ import annotations

import pytest

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")

from idloop_nodes.graph_start import DISCOVERY_TIME, NEW, DuplicateNodeCheck


def test_it_looks_around_first_and_then_is_alone():
    watch = DuplicateNodeCheck(10.0 + DISCOVERY_TIME)
    assert not watch.is_unique(1, 10.0)
    assert watch.is_unique(1, 10.0 + DISCOVERY_TIME)
    assert DuplicateNodeCheck(10.0).is_unique(1, 10.0)


def test_a_namesake_has_its_time_to_speak_and_one_that_is_dead_does_not():
    watch = DuplicateNodeCheck(0.0)
    assert not watch.is_unique(2, 5.0)
    assert not watch.is_unique(2, 5.0 + 0.9 * NEW)
    assert watch.is_unique(2, 5.0 + NEW)
    assert watch.is_unique(1, 5.0)


def test_who_hears_another_before_it_is_ready_came_second():
    assert DuplicateNodeCheck(0.0).is_second(3.0)


@pytest.mark.parametrize(("after", "second"), [(0.5 * NEW, True), (2.0 * NEW, False)])
def test_one_that_has_been_ready_for_a_while_goes_on(after, second):
    watch = DuplicateNodeCheck(0.0)
    watch.announced(3.0)
    assert not watch.is_second(3.0)  # its own word
    assert watch.is_second(3.0 + after) is second
