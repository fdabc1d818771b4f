"""Whether command and motion count in the same direction.

Which way a command counts as positive is a convention of the wiring, and so is that of a sensor. Where they are
opposite a gain becomes negative, or none will do.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from idloop.physics.model import Model

AGAINST = "the measured motion follows minus the command"
TURN = (
    "Command and motion count in opposite directions: turn one of the two, with `scale: -1` for it in the mapping file"
    " of the import"
)
_GAIN = "drive.gain"
# Standard errors by which a gain must be on the other side of zero.
_SURE = 3.0


def turned(start: Model, fitted: Model) -> str:
    """What to say of a fit in which the drive pushes the other way than in the model that it began with.

    Returns
    -------
    str
        Empty where it pushes the same way, or may.
    """
    before, after = start.parameter(_GAIN), fitted.parameter(_GAIN)
    if before.value * after.value >= 0.0 or abs(after.value) <= _SURE * (after.stderr or 0.0):
        return ""
    unit = f" {after.unit}" if after.unit.strip("-") else ""
    return (
        f"{AGAINST}: {_GAIN} is {after.value:.4g}{unit} here, and {before.value:.4g}{unit} in the model. {TURN},"
        " or give the model a gain of that sign"
    )
