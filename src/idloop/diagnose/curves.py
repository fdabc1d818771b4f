"""Curves that what a model leaves may be learnt as; forces and corrections of the command, piecewise linear."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from idloop.diagnose.period import remaining_period
from idloop.diagnose.proposals import Proposal
from idloop.diagnose.unknown import KNOTS, Curve
from idloop.physics.effect import BODY, INPUT, Effect, ParameterSpec
from idloop.physics.hooks import hook
from idloop.physics.model import ActiveEffect, Model
from idloop.physics.parameter import Parameter
from idloop.physics.trial import Trial

if TYPE_CHECKING:
    from idloop.diagnose.screen import Screen

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Shape(Curve):
    """A curve that the errors may follow."""

    # Height of a trial curve.
    step: float
    # Of the whitened errors, by heights at the knots; None where they cannot be simulated.
    change: Callable[[Array], Array | None]
    # Shapes that this one was chosen from.
    tried: int = 1

    @property
    def text(self) -> str:
        """In words, such as "a force over the velocity"."""
        return f"{'the' if self.coefficient else 'a'} {self.of} over the {self.variable}"


@njit(cache=True, error_model="numpy")
def _clipped(value: float, values: Any) -> float:
    """Place of a value among the knots, the ends beyond them."""
    return float(min(max((value - values[0]) / values[1], 0.0), 15.999999))


@njit(cache=True, error_model="numpy")
def _height(place: float, values: Any) -> float:
    i = min(int(place), 15)
    return float(values[2 + i] + (place - i) * (values[3 + i] - values[2 + i]))


@hook
def over_velocity(position: float, velocity: float, inertia: float, elapsed: float, state: Any, values: Any) -> float:
    """Force at the velocity."""
    return float(_height(_clipped(velocity, values), values))


@hook
def over_position(position: float, velocity: float, inertia: float, elapsed: float, state: Any, values: Any) -> float:
    """Force at the position."""
    return float(_height(_clipped(position, values), values))


@hook
def over_period(position: float, velocity: float, inertia: float, elapsed: float, state: Any, values: Any) -> float:
    """Force at the place within the period that the knots span: the last is the first."""
    return float(_height((position - values[0]) / values[1] % 16.0, values))


@hook
def over_command(value: float, velocity: float, sent: float, elapsed: float, state: Any, values: Any) -> float:
    """Command plus what is missing of it at that command."""
    return float(value + _height(_clipped(value, values), values))


_SPECS = (
    ParameterSpec("low", "-", held=True),
    ParameterSpec("width", "-", start=1.0, held=True),
    *(ParameterSpec(f"knot{i}", "-") for i in range(KNOTS)),
)


def _curve(over: str, site: str, **equations: Any) -> Effect:
    return Effect(name=f"curve_over_{over}", site=site, text="", parameters=_SPECS, order=45, **equations)


CURVES = {
    "velocity": _curve("velocity", BODY, force=over_velocity),
    "position": _curve("position", BODY, force=over_position),
    "period": _curve("period", BODY, force=over_period),
    "command": _curve("command", INPUT, command=over_command),
}


@dataclass(frozen=True)
class CurveProposal(Proposal):
    """A curve over one variable, by its first knot and the distance of its knots."""

    low: float = 0.0
    width: float = 1.0

    def model(self, values: Trial) -> Model:
        """The base with this curve, the heights at its knots given."""
        active = ActiveEffect(self.effect, self.at)
        added = tuple(
            Parameter(f"{active.name}.{name}", float(value), -np.inf, np.inf, False, None, "-")
            for name, value in {"low": self.low, "width": self.width, **values}.items()
        )
        return replace(self.base, effects=(*self.base.effects, active), parameters=(*self.base.parameters, *added))


def force_shapes(screen: Screen) -> list[Shape]:
    """A force over velocity, position or a period of it, and the command over itself, in the range of the records."""
    setting, sizes, model = screen.setting, screen.sizes, screen.parent.model
    units, body = model.units, model.bodies[0]
    _, fastest, middle, span = sizes.bodies[0]

    def shape(name: str, over: str, unit: str, middle: float, reach: float, tried: int = 1) -> Shape:
        of, of_unit, at, size = "force", units.force, body, setting.force
        if name == "command":
            of, of_unit, at, size = "command", units.input, INPUT, sizes.command
        low, width = middle - 0.5 * reach, reach / (KNOTS - 1)
        curve = CurveProposal(CURVES[name], at, model, low=low, width=width)
        return Shape(
            of, of_unit, over, unit, np.asarray(low + width * np.arange(KNOTS)), name == "period", 0.01 * size,
            lambda heights: screen.moved(curve, {f"knot{i}": heights[i % len(heights)] for i in range(KNOTS)}), tried,
        )  # fmt: skip

    shapes = [
        shape("velocity", f"{body}.velocity", f"{units.position}/s", 0.0, 2.0 * fastest),
        shape("position", f"{body}.position", units.position, middle, span),
        shape("command", "command", units.input, 0.0, 2.0 * sizes.command_most),
    ]
    period = remaining_period(model, setting)
    if period is not None:
        shapes.append(shape("period", f"{body}.position", units.position, middle, *period))
    return shapes
