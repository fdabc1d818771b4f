"""Two publishers on one topic: their messages are interleaved and contradict each other."""

from __future__ import annotations

from idloop.records.bags.publishers import Publishers
from idloop.records.finding import Finding
from idloop.records.inspection.axis import Axis
from idloop.records.inspection.faults.fault import fault
from idloop.spelling import joined_names

_BY = {
    "clocks": "two clocks {:.3g} s apart",
    "fields": "two sets of joints or fields",
    "stamps": "two grids of stamps",
}


def check(axis: Axis) -> list[Finding]:
    """Name the topics of the joint that hold two sequences of messages."""
    return [_finding(found) for found in axis.publishers]


def _finding(found: Publishers) -> Finding:
    many, few = found.counts
    by = _BY[found.evidence].format(abs(found.clock_offset))
    differ = f", and {joined_names(found.contradicting)} of both differ" if found.contradicting else ""
    return fault(
        "two_publishers",
        found.topic,
        f"{found.topic}: two publishers, {many} and {few} messages with {by}{differ}",
        "stop one of the two nodes (`ros2 topic info --verbose`) and record again",
        evidence={"first": float(many), "second": float(few), "clock_offset": found.clock_offset},
        spoils=("identification",),
        count=few,
    )
