"""Losses, counted by publication numbers or by stamps."""

from __future__ import annotations

import pytest

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")

from idloop_nodes.streams.stream_watch import SequenceCheck


def number(value, source=b"a"):
    return {"publication_sequence_number": value, "publisher_gid": {"data": source}}


def test_losses_are_counted_for_each_publisher():
    check = SequenceCheck(0)
    for information in (number(4), number(5), number(1, b"b"), number(8), number(2, b"b")):
        check.take(information, 0)
    assert check.lost == 2
    assert check.received == 5


def test_losses_without_numbers_are_counted_on_the_grid():
    check = SequenceCheck(10)
    for stamp in (0, 10, 40, 50):
        check.take({}, stamp)
    assert check.lost == 2
