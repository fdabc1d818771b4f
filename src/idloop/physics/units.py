"""Units in a model file, and the units derived from them."""

from __future__ import annotations

from dataclasses import dataclass

from idloop.errors import InputError
from idloop.spelling import did_you_mean_or_known

ALIASES = {"Nm": "N·m", "N.m": "N·m", "N*m": "N·m", "N m": "N·m", "1": "-", "": "-"}
# The last four are of a drive with its own position or velocity loop.
INPUT_UNITS = ("V", "A", "N·m", "N", "-", "rad", "m", "rad/s", "m/s")
# Force unit by position unit.
FORCES = {"rad": "N·m", "m": "N", "V": "V"}
NAMES = {"rad": "rotary", "m": "linear", "V": "electrical"}


@dataclass(frozen=True)
class Units:
    """The units of one model."""

    # Unit of the command, of positions and of forces
    input: str
    position: str
    force: str

    def fill(self, template: str, output: str = "") -> str:
        """Write a parameter's unit out, such as ``{force}·s/{position}``."""
        over = f"({self.input})" if "/" in self.input else self.input
        template = template.replace("/{input}", f"/{over}")
        return template.format(input=self.input, position=self.position, force=self.force, output=output)

    @property
    def inertia(self) -> str:
        """Unit of inertia or mass."""
        return {"rad": "kg·m²", "m": "kg"}.get(self.position, f"{self.force}·s²/{self.position}")


def input_unit(unit: str, where: str) -> str:
    """Check the unit of a command. Raises InputError: not a unit of a command."""
    unit = ALIASES.get(unit, unit)
    if unit not in INPUT_UNITS:
        raise InputError(f"{where}: unknown unit '{unit}'{did_you_mean_or_known(unit, INPUT_UNITS)}")
    return unit


def position_unit(unit: str, field: str, where: str) -> str:
    """Position unit that belongs to the unit of an output. Raises InputError: not a unit of a position or velocity."""
    known = [name if field == "position" else f"{name}/s" for name in FORCES]
    if unit not in known:
        raise InputError(f"{where}: unknown unit '{unit}' of a {field}{did_you_mean_or_known(unit, known)}")
    return unit.removesuffix("/s")
