"""Command and measurement stamped by two clocks, or one of them by simulated time."""

from __future__ import annotations

from idloop.records.finding import Finding
from idloop.records.inspection.axis import Axis
from idloop.records.inspection.clocks import clock_finding


def check(axis: Axis) -> list[Finding]:
    """Compare the stamps of both streams at equal receive times."""
    if axis.command_stream is None or axis.measured_stream is None:
        return []
    found = clock_finding(axis.command_stream, axis.measured_stream)
    return [] if found is None else [found]
