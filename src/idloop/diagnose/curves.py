"""Curves that an unknown force can be learnt as: piecewise linear over one variable."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from idloop.diagnose.proposals import Proposal
from idloop.physics.effect import BODY, INPUT, Effect, ParameterSpec
from idloop.physics.hooks import hook
from idloop.physics.model import ActiveEffect, Model
from idloop.physics.parameter import Parameter
from idloop.physics.trial import Trial

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
        Height of the trial curves.
    closed : bool
        The last knot is the first again.
    """

    low: float = 0.0
    width: float = 1.0
    step: float = 1.0
    closed: bool = False

    def trials(self) -> list[Trial]:
        """One hat on every knot."""
        hats = [{f"knot{i}": self.step} for i in range(KNOTS)]
        if self.closed:
            hats = [hats[0] | hats[-1], *hats[1:-1]]
        return [{"low": self.low, "width": self.width, **hat} for hat in hats]

    @property
    def knots(self) -> Any:
        """Where the knots are, shape (KNOTS,)."""
        return self.low + self.width * np.arange(KNOTS)

    def model(self, values: Trial) -> Model:
        """The base with this curve."""
        active = ActiveEffect(self.effect, self.at)
        added = tuple(
            Parameter(f"{active.name}.{s.name}", float(values.get(s.name, s.start)), -np.inf, np.inf, False, None, "-")
            for s in self.effect.parameters
        )
        return replace(self.base, effects=(*self.base.effects, active), parameters=(*self.base.parameters, *added))
