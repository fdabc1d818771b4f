"""What remains when no effect of the catalogue explains it: a learnt force or command curve."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from idloop.diagnose.curves import CURVES, KNOTS, Curve
from idloop.diagnose.period import remaining_period
from idloop.diagnose.unevenness import stretches
from idloop.physics.effect import INPUT

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
    period : float or None
        Of a force that repeats over the position: the curve is that of one period.
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

    @property
    def along(self) -> str:
        """The variable as the label of an axis."""
        return self.variable if self.period is None else f"{self.variable} within a period"

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
            "period": self.period,
        }

    @classmethod
    def from_dict(cls, document: dict[str, Any]) -> UnknownStructure:
        """Read what `to_dict` wrote."""
        arrays = {name: np.asarray(document[name], dtype=float) for name in ("at", "force", "band")}
        return cls(**{**document, **arrays})


def unknown_structure(screen: Screen, level: float) -> UnknownStructure | None:
    """Look for structure in the errors that no effect of the catalogue explains.

    A force over velocity, over position, over the place within a period of the position, and a
    correction of the command are learnt as piecewise linear curves, linearised at the model as it is;
    what white errors would give by chance is known from the F distribution, shared between them and all
    periods that were looked at.

    Parameters
    ----------
    screen : Screen
        Errors of the model.
    level : float
        Probability of seeing structure where there is none.

    Returns
    -------
    UnknownStructure or None
    """
    from scipy.stats import f as f_distribution
    from scipy.stats import norm

    fits = [fit for curve in _curves(screen) if (fit := _learn(screen, curve, 1)) is not None]
    period = remaining_period(screen.parent.model, screen.setting)
    if period is not None:
        again = _learn(screen, _repeating(screen, period.length), period.tried)
        fits += [again] if again is not None else []

    def chance(fit: _Fit) -> float:
        return float(f_distribution.sf(fit.ratio, fit.directions, fit.freedom)) * len(fits) * fit.tried

    best = max((fit for fit in fits if chance(fit) < level), key=lambda fit: fit.share, default=None)
    if best is None:
        return None
    p_value = chance(best)
    best = replace(best, value=_strength(screen, best) * best.value)
    curve, name = best.curve, screen.parent.model.bodies[0]
    units = screen.parent.model.units
    command = curve.effect.site == INPUT
    over = "position" if curve.closed else curve.effect.name.removeprefix("curve_over_")
    variable = "command" if command else f"{name}.{over}"
    unit = units.input if command else units.position + ("/s" if "velocity" in variable else "")
    force_unit = units.input if command else units.force
    length = 16.0 * curve.width if curve.closed else None
    what = f"repeat every {length:.5g} {unit} of the position" if length else f"still follow the {over}"
    return UnknownStructure(
        variable=variable,
        unit=unit,
        force_unit=force_unit,
        at=curve.knots[best.known],
        force=best.value[best.known],
        band=float(norm.ppf(0.975)) * best.spread[best.known],
        share=best.share,
        text=(
            f"the errors {what} (p = {max(p_value, 1e-300):.1g}) in a way "
            f"that no effect of the catalogue explains: a learnt {'command' if command else 'force'} of up to "
            f"{float(np.max(np.abs(best.value[best.known]))):.3g} {force_unit} remains"
        ),
        period=length,
    )


@dataclass(frozen=True)
class _Fit:
    curve: Curve
    value: Array
    spread: Array
    known: NDArray[np.bool_]
    share: float
    ratio: float
    directions: int
    freedom: int
    tried: int


def _curves(screen: Screen) -> list[Curve]:
    model, sizes = screen.parent.model, screen.sizes
    body = model.bodies[0]
    _, fastest, middle, span = sizes.bodies[0]
    force, command = screen.setting.force, sizes.command_most
    ranges = {
        "velocity": (body, -fastest, 2.0 * fastest, 0.01 * force),
        "position": (body, middle - 0.5 * span, span, 0.01 * force),
        "command": ("input", -command, 2.0 * command, 0.01 * sizes.command),
    }
    if screen.setting.kind == "force":
        # The command is what a force balance explains: a curve over it would explain it by itself.
        del ranges["command"]
    return [
        Curve(CURVES[name], at, model, low=low, width=reach / (KNOTS - 1), step=step)
        for name, (at, low, reach, step) in ranges.items()
    ]


def _repeating(screen: Screen, period: float) -> Curve:
    model = screen.parent.model
    low = screen.sizes.bodies[0][2] - 0.5 * period
    step, width = 0.01 * screen.setting.force, period / (KNOTS - 1)
    return Curve(CURVES["period"], model.bodies[0], model, low=low, width=width, step=step, closed=True)


def _strength(screen: Screen, fit: _Fit) -> float:
    """How much of a learnt curve explains most beside the parameters as they are.

    The projection that learns it also lets the noise model change by a little, which is no small change once the force
    is gone.
    """
    from scipy.optimize import minimize_scalar

    curve = fit.curve
    knots = {f"knot{i}": value for i, value in enumerate(fit.value.tolist())}

    def left(share: float) -> float:
        trial = {"low": curve.low, "width": curve.width, **{name: share * value for name, value in knots.items()}}
        change = screen.moved(curve, trial)
        if change is None:
            return np.inf
        errors = screen.whitened + change
        return float(errors @ errors)

    found = minimize_scalar(left, bounds=(0.0, 2.0), method="bounded", options={"xatol": 0.05, "maxiter": 10})
    return float(found.x) if found.fun < left(1.0) else 1.0


def _learn(screen: Screen, curve: Curve, tried: int) -> _Fit | None:
    """Least squares of a curve's knots on the errors, with what the free parameters do projected out."""
    columns = [screen.moved(curve, trial) for trial in curve.trials()]
    if any(column is None for column in columns):
        return None
    raw = np.column_stack([column for column in columns if column is not None])
    own = raw - screen.basis @ (screen.basis.T @ raw)
    size = np.linalg.norm(own, axis=0)
    known = size > 1e-3 * max(float(np.max(size)), 1e-300)
    if not np.any(known):
        return None
    left, weight, right = np.linalg.svd(own[:, known] / size[known], full_matrices=False)
    kept = weight > 1e-2 * weight[0]
    left, weight, right = left[:, kept], weight[kept], right[kept]
    scores = -(left.T @ screen.errors)
    rest = screen.errors + left @ scores
    directions, freedom = len(scores), max(len(rest) - len(scores) - screen.basis.shape[1], 1)
    variance = float(rest @ rest) / freedom
    # Uneven variance along the curve makes it look surer than it is.
    meat = (left * rest[:, None] ** 2).T @ left
    sums = np.add.reduceat(left * rest[:, None], stretches(len(rest)), axis=0)
    uneven = max(1.0, *(float(np.max(np.linalg.eigvalsh(m))) / variance for m in (meat, sums.T @ sums)))
    solve = (right.T / weight) / size[known][:, None] * curve.step
    value, spread = np.zeros(len(known)), np.zeros(len(known))
    value[known] = solve @ scores
    spread[known] = np.sqrt(np.sum(solve**2, axis=1) * variance * uneven)
    if curve.closed:
        value, spread, known = (np.append(part, part[0]) for part in (value, spread, known))
    power = float(scores @ scores)
    return _Fit(
        curve,
        value,
        spread,
        known,
        share=power / max(float(screen.errors @ screen.errors), 1e-300),
        ratio=power / directions / (variance * uneven),
        directions=directions,
        freedom=freedom,
        tried=tried,
    )
