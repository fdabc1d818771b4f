"""The residual curve that remains when no effect of the catalogue explains it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from idloop.p_values import p_text
from idloop.physics.units import Units
from idloop.validation.words import short

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

Array = NDArray[np.float64]

# Knots of a force or a command, of a coefficient over the position, and of a slow drift over time.
KNOTS, COEFFICIENT_KNOTS, TIME_KNOTS = 17, 13, 5
# Name of the variable that is the place of a record among all, from 1 on.
RECORD = "record"
# Most records that are compared with each other.
MOST_RECORDS = 20
# Turns from which on a curve is periodic over the turn.
TURNS = 1.5


@dataclass(frozen=True)
class UnknownStructure:
    """A remaining force as a curve over the variable that explains it best.

    Attributes
    ----------
    variable : str
        ``velocity``, ``position``, ``position within a turn`` with the body, ``command``, ``time``, or
        ``record`` (the first is 1).
    unit, force_unit : str
        Units of the variable and of the curve.
    at, force, band : array, shape (k,)
        The curve and the half-width of its 95 % band.
    share : float
        Share of the one-step errors' power that it explains.
    text : str
        One sentence.
    period : float or None
        Of a force that repeats over the position: the curve is that of one period.
    of : str
        What the curve gives: ``force``, ``command``, or the coefficient that is not constant: ``inertia``, ``viscous
        friction``, ``dry friction``, or ``drive`` (its force as a part of what the model gives it).
    rivals : tuple of str
        Other curves that tie with it, in words.
    """

    variable: str
    unit: str
    force_unit: str
    at: Array
    force: Array
    band: Array
    share: float
    text: str
    period: float | None = None
    of: str = "force"
    rivals: tuple[str, ...] = ()

    @property
    def along(self) -> str:
        """The variable as the label of an axis."""
        return self.variable if self.period is None else f"{self.variable} within a period"

    @property
    def coefficient(self) -> bool:
        """Whether it is a coefficient of the model that is not constant."""
        return self.of not in ("force", "command")

    @property
    def what(self) -> str:
        """The curve as the label of an axis."""
        return f"change of the {self.of}" if self.coefficient else f"remaining {self.of}"

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        arrays = {name: getattr(self, name).tolist() for name in ("at", "force", "band")}
        return {**vars(self), **arrays, "rivals": list(self.rivals)}

    @classmethod
    def from_dict(cls, document: dict[str, Any]) -> UnknownStructure:
        """Read what `to_dict` wrote."""
        arrays = {name: np.asarray(document[name], dtype=float) for name in ("at", "force", "band")}
        return cls(**{**document, **arrays, "rivals": tuple(document.get("rivals", ()))})


def coefficient_units(units: Units) -> dict[str, str]:
    """Coefficients that may not be constant, and their units."""
    return {
        "inertia": units.inertia,
        "viscous friction": units.fill("{force}·s/{position}"),
        "dry friction": units.force,
        "drive": "-",
    }


def coefficient_splines(knots: Array, *, closed: bool) -> CubicSpline:
    """Cubic splines that are 1 at one knot each: smooth, since the slope of an inertia makes a force too."""
    from scipy.interpolate import CubicSpline

    hats = np.eye(len(knots))
    if closed:
        hats = np.vstack([hats[:-1, :-1], hats[:1, :-1]])
    return CubicSpline(knots, hats, bc_type="periodic" if closed else "natural")


@dataclass(frozen=True)
class Curve:
    """What is not constant over one variable: a force, a command or a coefficient, by its heights at knots."""

    of: str
    of_unit: str
    over: str
    unit: str
    knots: Array
    # Periodic: the last knot has the height of the first.
    closed: bool

    @property
    def of_the_drive(self) -> bool:
        """Whether it describes the drive, from command to force."""
        return self.of in ("command", "drive")

    @property
    def coefficient(self) -> bool:
        """Whether it is one of a coefficient, of which only the change along it counts."""
        return self.of not in ("force", "command")

    @property
    def constant(self) -> str:
        """What has one value in each record, in words."""
        return "a constant force" if self.of == "force" else f"the {self.of}"

    @property
    def between_records(self) -> str:
        """That it differs between the records, in words."""
        return f"{self.constant} that differs between the records"

    @property
    def variable(self) -> str:
        """The variable without its body."""
        return self.over.partition(".")[2] or self.over

    def at_knots(self, values: NDArray[Any]) -> NDArray[Any]:
        """Values of the heights, at all knots."""
        return np.append(values, values[0]) if self.closed else values

    def structure(
        self, errors: str, p_value: float, force: Array, band: Array, share: float, period: float | None = None
    ) -> UnknownStructure:
        """As a diagnosis reports it, by heights and half-widths of their band; NaN where they are not known.

        `errors`, such as "the errors of the force", follow it; `period` is that of a force which repeats.
        """
        force, band = self.at_knots(force), self.at_knots(band)
        known = np.isfinite(force)
        at, force, band = self.knots[known], force[known], band[known]
        if self.over == RECORD:
            text = self._from_record_to_record(at, force, p_value)
            return UnknownStructure(self.over, self.unit, self.of_unit, at, force, band, share, text, None, self.of)
        text = f"{errors} still follow the {self.variable} "
        if self.coefficient:
            text = f"the {self.of} changes with the {self.variable} "
        elif period:
            text = f"{errors} repeat every {period:.5g} {self.unit} of the position "
        text += f"({p_text(p_value)}) in a way that no candidate effect explains: "
        if self.coefficient:
            text += f"by {self._size(float(np.ptp(force)))} from its minimum to its maximum, as fitted"
            if self.over == "time":
                text += "; the frequency of a sweep or the motion of another joint would look the same"
        else:
            text += f"a fitted {self.of} of up to {short(float(np.max(np.abs(force))))} {self.of_unit} remains"
        return UnknownStructure(self.over, self.unit, self.of_unit, at, force, band, share, text, period, self.of)

    def _size(self, value: float) -> str:
        return f"{100.0 * value:.3g} %" if self.of_unit == "-" else f"{short(value)} {self.of_unit}"

    def _from_record_to_record(self, at: Array, heights: Array, p_value: float) -> str:
        """That a constant force or a coefficient differs between the records."""
        low, high = (round(float(at[place])) for place in (np.argmin(heights), np.argmax(heights)))
        apart = self._size(float(np.ptp(heights)))
        return (
            f"{self.constant} differs between the records ({p_text(p_value)}): it is {apart} larger in record {high}"
            f" than in record {low}, in the order given. Fit records of one state of the machine together: the model"
            " has no load, supply or temperature that changes between them"
        )
