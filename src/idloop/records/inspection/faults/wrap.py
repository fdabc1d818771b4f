"""A position that jumps by the range of its encoder."""

from __future__ import annotations

from idloop.records.finding import Finding
from idloop.records.inspection.axis import Axis
from idloop.records.inspection.faults.fault import around, fault


def check(axis: Axis) -> list[Finding]:
    """Look for jumps of one size from one end of the range to the other."""
    wraps = axis.wraps
    if wraps is None:
        return []
    name, unit = axis.name("position"), axis.unit("position")
    many = "once" if wraps.rows.size == 1 else f"{wraps.rows.size} times"
    return [
        fault(
            "wrapped_position",
            name,
            f"{name} jumps {many} by {wraps.span:.4g} {unit} from one end of its range to the other: the encoder wraps",
            f"set `wrap: {wraps.span:.6g}` for it in the mapping, or use `Record.unwrapped`",
            evidence={"span": wraps.span, "jumps": float(wraps.rows.size)},
            spoils=("identification",),
            count=int(wraps.rows.size),
            places=around(axis.time, wraps.rows),
        )
    ]
