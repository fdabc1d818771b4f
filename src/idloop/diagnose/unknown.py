"""What remains when no effect of the catalogue explains it: a learnt force or command curve."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from idloop.diagnose.screen import Screen

Array = NDArray[np.float64]


@dataclass(frozen=True)
class UnknownStructure:
    """A remaining force as a curve over the variable that explains it best.

    Attributes
    ----------
    variable : str
        ``velocity``, ``position`` or ``command``, with the body.
    unit, force_unit : str
        Units of the variable and of the curve.
    at, force, band : array, shape (k,)
        The curve and the half-width of its 95 % band.
    share : float
        Share of the one-step errors' power that it explains.
    text : str
        One sentence.
    """

    variable: str
    unit: str
    force_unit: str
    at: Array
    force: Array
    band: Array
    share: float
    text: str

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {
            "variable": self.variable,
            "unit": self.unit,
            "force_unit": self.force_unit,
            "at": self.at.tolist(),
            "force": self.force.tolist(),
            "band": self.band.tolist(),
            "share": self.share,
            "text": self.text,
        }


def unknown_structure(screen: Screen, level: float, seed: int) -> UnknownStructure | None:
    """Look for structure in the errors that no effect of the catalogue explains.

    Parameters
    ----------
    screen : Screen
        Errors of the model.
    level : float
        Probability of seeing structure where there is none.
    seed : int

    Returns
    -------
    UnknownStructure or None
    """
    return None
