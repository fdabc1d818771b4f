"""A position that jumps by the range of its encoder."""

from __future__ import annotations

from math import pi

from idloop.records.finding import Finding
from idloop.records.inspection.axis import Axis
from idloop.records.inspection.faults.fault import around, fault

# Usual ranges of encoders, in any unit, taken where the jumps are as large to this accuracy.
_RANGES = (2.0 * pi, pi, 1.0, 360.0, 180.0, *(float(1 << bits) for bits in range(8, 25)))
_NEAR = 0.01


def check(axis: Axis) -> list[Finding]:
    """Look for jumps of one size from one end of the range to the other."""
    wraps = axis.wraps
    if wraps is None:
        return []
    name, unit = axis.name("position"), axis.unit("position")
    usual = next((one for one in _RANGES if abs(wraps.span / one - 1.0) < _NEAR), None)
    span = usual or wraps.span
    many = "once" if wraps.rows.size == 1 else f"{wraps.rows.size} times"
    or_else = ", or two recordings were joined" if wraps.rows.size == 1 and usual is None else ""
    return [
        fault(
            "wrapped_position",
            name,
            f"{name} jumps {many} by {span:.4g} {unit} from one end of its range to the other: the encoder wraps"
            f"{or_else}",
            f"set `wrap: {span:.7g}` for it in the mapping, or use `Record.unwrapped`",
            evidence={"span": wraps.span, "jumps": float(wraps.rows.size)},
            spoils=("identification",),
            count=int(wraps.rows.size),
            places=around(axis.time, wraps.rows),
        )
    ]
