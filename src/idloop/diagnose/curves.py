"""Curves that an unknown force can be learnt as: piecewise linear over one variable."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from idloop.diagnose.period import remaining_period
from idloop.diagnose.proposals import Proposal
from idloop.diagnose.shape import Shape
from idloop.physics.effect import BODY, INPUT, Effect, ParameterSpec
from idloop.physics.hooks import hook
from idloop.physics.model import ActiveEffect, Model
from idloop.physics.parameter import Parameter
from idloop.physics.trial import Trial

if TYPE_CHECKING:
    from idloop.diagnose.screen import Screen

Array = NDArray[np.float64]

KNOTS = 17


@hook
def over_velocity(position: float, velocity: float, inertia: float, elapsed: float, state: Any, values: Any) -> float:
    """Force at the velocity: linear between the knots, constant beyond them."""
    place = min(max((velocity - values[0]) / values[1], 0.0), 15.999999)
    i = int(place)
    return float(values[2 + i] + (place - i) * (values[3 + i] - values[2 + i]))


@hook
def over_position(position: float, velocity: float, inertia: float, elapsed: float, state: Any, values: Any) -> float:
    """Force at the position: linear between the knots, constant beyond them."""
    place = min(max((position - values[0]) / values[1], 0.0), 15.999999)
    i = int(place)
    return float(values[2 + i] + (place - i) * (values[3 + i] - values[2 + i]))


@hook
def over_period(position: float, velocity: float, inertia: float, elapsed: float, state: Any, values: Any) -> float:
    """Force at the place within the period that the knots span: linear between them, the last is the first."""
    place = (position - values[0]) / values[1] % 16.0
    i = min(int(place), 15)
    return float(values[2 + i] + (place - i) * (values[3 + i] - values[2 + i]))


@hook
def over_command(value: float, velocity: float, sent: float, elapsed: float, state: Any, values: Any) -> float:
    """Command plus what is missing of it at that command."""
    place = min(max((value - values[0]) / values[1], 0.0), 15.999999)
    i = int(place)
    return float(value + values[2 + i] + (place - i) * (values[3 + i] - values[2 + i]))


_SPECS = (
    ParameterSpec("low", "-", held=True),
    ParameterSpec("width", "-", start=1.0, held=True),
    *(ParameterSpec(f"knot{i}", "-") for i in range(KNOTS)),
)


def _curve(name: str, site: str, **equations: Any) -> Effect:
    return Effect(name=name, site=site, text="", parameters=_SPECS, order=45, **equations)


CURVES = {
    "velocity": _curve("curve_over_velocity", BODY, force=over_velocity),
    "position": _curve("curve_over_position", BODY, force=over_position),
    "period": _curve("curve_over_period", BODY, force=over_period),
    "command": _curve("curve_over_command", INPUT, command=over_command),
}


@dataclass(frozen=True)
class Curve(Proposal):
    """A curve over one variable, laid over the range that the records cover.

    Attributes
    ----------
    low, width : float
        First knot and distance of the knots.
    step : float
        Height of a trial curve.
    closed : bool
        The last knot is the first again.
    """

    low: float = 0.0
    width: float = 1.0
    step: float = 1.0
    closed: bool = False

    def trial(self, heights: Array) -> Trial:
        """Values of a curve with these heights, shape (KNOTS,), or (KNOTS - 1,) of a closed one."""
        closed = np.append(heights, heights[0]) if self.closed else heights
        return {"low": self.low, "width": self.width, **{f"knot{i}": float(h) for i, h in enumerate(closed)}}

    @property
    def knots(self) -> Array:
        """Where the knots are, shape (KNOTS,)."""
        return np.asarray(self.low + self.width * np.arange(KNOTS))

    def model(self, values: Trial) -> Model:
        """The base with this curve."""
        active = ActiveEffect(self.effect, self.at)
        added = tuple(
            Parameter(f"{active.name}.{s.name}", float(values.get(s.name, s.start)), -np.inf, np.inf, False, None, "-")
            for s in self.effect.parameters
        )
        return replace(self.base, effects=(*self.base.effects, active), parameters=(*self.base.parameters, *added))


def force_shapes(screen: Screen) -> list[Shape]:
    """Forces over velocity, position and a period of it, and a correction of the command, over what the records cover.

    Parameters
    ----------
    screen : Screen
        Errors of the model.

    Returns
    -------
    list of Shape
    """
    setting, sizes, model = screen.setting, screen.sizes, screen.parent.model
    units, body = model.units, model.bodies[0]
    _, fastest, middle, span = sizes.bodies[0]
    most, force = sizes.command_most, 0.01 * setting.force

    def laid(name: str, at: str, low: float, reach: float, step: float, *, closed: bool = False) -> Curve:
        return Curve(CURVES[name], at, model, low=low, width=reach / (KNOTS - 1), step=step, closed=closed)

    curves = [
        (laid("velocity", body, -fastest, 2.0 * fastest, force), f"{body}.velocity", f"{units.position}/s", 1),
        (laid("position", body, middle - 0.5 * span, span, force), f"{body}.position", units.position, 1),
    ]
    own = laid("command", INPUT, -most, 2.0 * most, 0.01 * sizes.command)
    curves.append((own, "command", units.input, 1))
    period = remaining_period(model, setting)
    if period is not None:
        repeating = laid("period", body, middle - 0.5 * period.length, period.length, force, closed=True)
        curves.append((repeating, f"{body}.position", units.position, period.tried))
    return [_learnable(screen, *curve) for curve in curves]


def _learnable(screen: Screen, curve: Curve, over: str, unit: str, tried: int) -> Shape:
    at_input, units = curve.effect.site == INPUT, screen.parent.model.units
    return Shape(
        over=over,
        unit=unit,
        of="command" if at_input else "force",
        of_unit=units.input if at_input else units.force,
        knots=curve.knots,
        step=curve.step,
        change=lambda heights: screen.moved(curve, curve.trial(heights)),
        closed=curve.closed,
        repeats=curve.closed,
        tried=tried,
    )
