"""What remains when no effect of the catalogue explains it: a learnt force, command or coefficient curve."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from idloop.diagnose.learnt import Learnt
from idloop.diagnose.shape import Shape

if TYPE_CHECKING:
    from idloop.diagnose.screen import Screen

Array = NDArray[np.float64]

COMMAND, FORCE, DRIVE = "command", "force", "drive"
# What is about how the command becomes a force.
DRIVE_CURVES = (COMMAND, DRIVE)


@dataclass(frozen=True)
class UnknownStructure:
    """A remaining force as a curve over the variable that explains it best.

    Attributes
    ----------
    variable : str
        ``velocity``, ``position``, ``position within a turn`` with the body, ``command``, or ``time``.
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
        Other curves that this data cannot tell from it, in words.
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
    of: str = FORCE
    rivals: tuple[str, ...] = ()

    @property
    def along(self) -> str:
        """The variable as the label of an axis."""
        return self.variable if self.period is None else f"{self.variable} within a period"

    @property
    def coefficient(self) -> bool:
        """Whether it is a coefficient of the model that is not constant."""
        return self.of not in (FORCE, COMMAND)

    @property
    def of_the_drive(self) -> bool:
        """Whether it is about how the command becomes a force."""
        return self.of in DRIVE_CURVES

    @property
    def what(self) -> str:
        """The curve as the label of an axis."""
        return f"change of the {self.of}" if self.coefficient else f"remaining {self.of}"

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {
            "variable": self.variable,
            "unit": self.unit,
            "of": self.of,
            "force_unit": self.force_unit,
            "at": self.at.tolist(),
            "force": self.force.tolist(),
            "band": self.band.tolist(),
            "share": self.share,
            "text": self.text,
            "period": self.period,
            "rivals": list(self.rivals),
        }

    @classmethod
    def from_dict(cls, document: dict[str, Any]) -> UnknownStructure:
        """Read what `to_dict` wrote."""
        arrays = {name: np.asarray(document[name], dtype=float) for name in ("at", "force", "band")}
        return cls(**{**document, **arrays, "rivals": tuple(document.get("rivals", ()))})


def unknown_structure(screen: Screen, best: Learnt, p_value: float, rivals: tuple[str, ...] = ()) -> UnknownStructure:
    """Tell a curve in the errors that no effect of the catalogue explains.

    A force over velocity, over position, over the place within a period of the position, a correction of the command,
    and coefficients that change over position or time are learnt as curves, linearised at the model as it is.

    Parameters
    ----------
    screen : Screen
        Errors of the model.
    best : Learnt
    p_value : float
    rivals : tuple of str
        Other curves that this data cannot tell from it, in words.

    Returns
    -------
    UnknownStructure
    """
    from scipy.stats import norm

    best = replace(best, value=_strength(screen, best) * best.value)
    shape, known = best.shape, _closed(best.shape, best.known)
    # The mean of a coefficient is the model's own parameter.
    mean = 0.0 if not shape.coefficient else float(np.mean(best.value[best.known]))
    curve = _closed(shape, best.value - mean)
    length = float(shape.knots[-1] - shape.knots[0]) if shape.repeats else None
    repeats = f"{length:.5g} {shape.unit}" if length else ""
    alike = f"; this data cannot tell it from {', '.join(rivals)}" if rivals else ""
    return UnknownStructure(
        variable=shape.over,
        unit=shape.unit,
        force_unit=shape.of_unit,
        at=shape.knots[known],
        force=curve[known],
        band=float(norm.ppf(0.975)) * _closed(shape, best.spread)[known],
        share=best.share,
        text=curve_sentence("the errors", shape.of, shape.of_unit, shape.over, p_value, curve[known], repeats) + alike,
        period=length,
        of=shape.of,
        rivals=rivals,
    )


def curve_sentence(
    errors: str, of: str, of_unit: str, over: str, p_value: float, curve: Array, repeats: str = ""
) -> str:
    """What to say of a curve that something follows.

    Parameters
    ----------
    errors : str
        What follows it, such as "the errors".
    of, of_unit, over : str
        As of `UnknownStructure`.
    p_value : float
    curve : array
        Its heights.
    repeats : str
        The period after which it repeats, with its unit; empty where it does not.

    Returns
    -------
    str
    """
    over = over.partition(".")[2] or over
    by = f"(p = {max(p_value, 1e-300):.1g}) in a way that no effect looked for explains"
    if of in (FORCE, COMMAND):
        what = f"repeat every {repeats} of the position" if repeats else f"still follow the {over}"
        largest = float(np.max(np.abs(curve)))
        return f"{errors} {what} {by}: a learnt {of} of up to {largest:.3g} {of_unit} remains"
    apart = float(np.ptp(curve))
    size = f"{100.0 * apart:.3g} %" if of_unit == "-" else f"{apart:.3g} {of_unit}"
    return f"the {of} changes with the {over} {by}: by {size} from its least to its most, as learnt"


def _closed(shape: Shape, values: NDArray[Any]) -> NDArray[Any]:
    """Values at all knots: of a closed curve the last is the first."""
    return np.append(values, values[0]) if shape.closed else values


def _strength(screen: Screen, fit: Learnt) -> float:
    """How much of a learnt curve explains most beside the noise as it is.

    The projection that learns it also lets the noise model change by a little, which is no small change once the force
    is gone.
    """
    from scipy.optimize import minimize_scalar

    def left(share: float) -> float:
        change = fit.shape.change(share * fit.value)
        if change is None:
            return np.inf
        errors = screen.beside_parameters(screen.whitened + change)
        return float(errors @ errors)

    found = minimize_scalar(left, bounds=(0.0, 2.0), method="bounded", options={"xatol": 0.05, "maxiter": 10})
    return float(found.x) if found.fun < left(1.0) else 1.0
