"""A command that was measured instead of commanded."""

from __future__ import annotations

from idloop.records.finding import Finding
from idloop.records.inspection.axis import Axis
from idloop.records.inspection.measured_input import measured_input


def check(axis: Axis) -> list[Finding]:
    """Estimate how long after its stamp a command acts."""
    if not axis.command.size:
        return []
    return measured_input(axis.command_name, axis.input_time, axis.command, axis.time, axis.motions)
