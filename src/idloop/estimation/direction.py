"""Whether the signs of command and motion agree: wiring or sensor may be connected the other way round."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from idloop.physics.model import Model

OPPOSITE_DIRECTION = "the measured motion follows minus the command"
REVERSE_ADVICE = (
    "Command and motion count in opposite directions: turn one of the two, with `scale: -1` for it in the mapping file"
    " of the import"
)
_GAIN = "drive.gain"
# Standard errors by which the fitted gain must lie beyond zero.
_SIGNIFICANT = 3.0


def gain_is_turned(start: Model, fitted: Model) -> bool:
    """Whether the fitted drive gain has the opposite sign of the starting value."""
    return start.parameter(_GAIN).value * fitted.parameter(_GAIN).value < 0.0


def opposite_direction_warning(start: Model, fitted: Model) -> str:
    """Warning that the fitted drive gain has the opposite sign of the starting value; empty where that is not sure."""
    before, after = start.parameter(_GAIN), fitted.parameter(_GAIN)
    if not gain_is_turned(start, fitted) or abs(after.value) <= _SIGNIFICANT * (after.stderr or 0.0):
        return ""
    unit = f" {after.unit}" if after.unit.strip("-") else ""
    return (
        f"{OPPOSITE_DIRECTION}: {_GAIN} is {after.value:.4g}{unit} here, and {before.value:.4g}{unit} in the model."
        f" {REVERSE_ADVICE}, or give the model a gain of that sign"
    )
