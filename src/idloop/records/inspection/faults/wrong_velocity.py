"""A velocity that is not the derivative of the position, or that a driver computed from it."""

from __future__ import annotations

from idloop.records.finding import Finding
from idloop.records.inspection.axis import Axis
from idloop.records.inspection.differenced import differenced_columns
from idloop.records.inspection.velocity_check import wrong_velocities


def check(axis: Axis) -> list[Finding]:
    """Compare the integral of the velocity with the position, and look for a difference of positions in it."""
    wrong = wrong_velocities(axis.time, axis.columns, axis.units)
    return wrong or differenced_columns(axis.time, axis.columns)
