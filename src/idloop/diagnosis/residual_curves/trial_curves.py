"""Trial curves for prediction errors: a force or a command over one variable, and coefficients that are not constant.

A machine whose inertia changes over the turn, whose friction falls as it warms, or whose motor is weaker at some angles
lacks a force that is a curve times the acceleration, the speed or the command.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from idloop.diagnosis.evidence.predicted_motion import PredictedMotion, predicted_motion
from idloop.diagnosis.residual_curves.unknown_structure import (
    COEFFICIENT_KNOTS,
    KNOTS,
    MOST_RECORDS,
    RECORD,
    TIME_KNOTS,
    TURNS,
    Curve,
    coefficient_splines,
    coefficient_units,
)
from idloop.diagnosis.screening.proposals import Proposal
from idloop.physics.effect import BODY, INPUT, Effect, EffectParameter
from idloop.physics.hooks import hook
from idloop.physics.model import ActiveEffect, Model
from idloop.physics.parameter import Parameter
from idloop.physics.trial import Trial

if TYPE_CHECKING:
    from idloop.diagnosis.screening.score_test import Screen

Array = NDArray[np.float64]
# The force that a change of a coefficient makes, by the motion, the change and its slope along the position.
_Force = Callable[[PredictedMotion, Array, Array], Array]


@dataclass(frozen=True)
class TrialCurve(Curve):
    """A curve that the errors may follow."""

    # Height of a trial curve: it makes a hundredth of the drive's force, next to nothing.
    step: float
    # Of the whitened errors, by heights at the knots; None where they cannot be simulated.
    change: Callable[[Array], Array | None]
    # Curves that this one was chosen from.
    tried: int = 1

    @property
    def text(self) -> str:
        """In words, such as "a force over the velocity"."""
        if self.over == RECORD:
            return self.between_records
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
    EffectParameter("low", "-", held=True),
    EffectParameter("width", "-", start=1.0, held=True),
    *(EffectParameter(f"knot{i}", "-") for i in range(KNOTS)),
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


def force_trials(screen: Screen) -> list[TrialCurve]:
    """A force over velocity, position or a period of it, and the command over itself, in the range of the records."""
    estimation, sizes, model = screen.estimation, screen.sizes, screen.parent.model
    units, body = model.units, model.bodies[0]
    _, fastest, middle, span = sizes.bodies[0]

    def over(name: str, over: str, unit: str, middle: float, reach: float, tried: int = 1) -> TrialCurve:
        of, of_unit, at, size = "force", units.force, body, estimation.force
        if name == "command":
            of, of_unit, at, size = "command", units.input, INPUT, sizes.command
        low, width = middle - 0.5 * reach, reach / (KNOTS - 1)
        curve = CurveProposal(CURVES[name], at, model, low=low, width=width)

        def change(heights: Array) -> Array | None:
            return screen.response_to_effect(curve, {f"knot{i}": heights[i % len(heights)] for i in range(KNOTS)})

        knots = np.asarray(low + width * np.arange(KNOTS))
        return TrialCurve(of, of_unit, over, unit, knots, name == "period", 0.01 * size, change, tried)

    trials = [
        over("velocity", f"{body}.velocity", f"{units.position}/s", 0.0, 2.0 * fastest),
        over("position", f"{body}.position", units.position, middle, span),
        over("command", "command", units.input, 0.0, 2.0 * sizes.command_most),
    ]
    if screen.period is not None:
        trials.append(over("period", f"{body}.position", units.position, middle, *screen.period))
    return trials


def _of_inertia(motion: PredictedMotion, change: Array, slope: Array) -> Array:
    """An inertia that changes along the way takes a force at constant speed as well (Lagrange's equation)."""
    turning = -0.5 * slope * motion.velocity**2
    # An inertia is positive.
    inertia = np.maximum(motion.inertia + change, 0.1 * motion.inertia)
    return np.asarray(turning - change * (motion.inertia * motion.acceleration + turning) / inertia)


# By their signs a positive curve is more inertia, more friction, a stronger drive.
_FORCES: dict[str, _Force] = {
    "force": lambda motion, change, slope: change,
    "inertia": _of_inertia,
    "viscous friction": lambda motion, change, slope: -change * motion.velocity,
    "dry friction": lambda motion, change, slope: -change * np.sign(motion.velocity),
    "drive": lambda motion, change, slope: change * motion.drive,
}


def coefficient_trials(screen: Screen) -> list[TrialCurve]:
    """Every coefficient over the position of the driven body, the records and, but for the inertia, over time.

    Empty where nothing predicts the motion, see `predicted_motion`. None over time where the command is a sweep.
    """
    motions = predicted_motion(screen.parent)
    if motions is None or not all(np.all(np.isfinite(m.position + m.acceleration)) for m in motions):
        return []
    model = screen.parent.model
    unit, units = model.units.position, coefficient_units(model.units)

    def over_variable(
        over: str, unit: str, knots: Array, places: Sequence[Array], *, closed: bool = False
    ) -> list[TrialCurve]:
        splines = coefficient_splines(knots, closed=closed)
        slopes = splines.derivative()
        inside = [np.clip(place, knots[0], knots[-1]) for place in places]
        return along(over, unit, knots, [(splines(at), slopes(at)) for at in inside], closed=closed)

    def along(
        over: str, unit: str, knots: Array, heights_of: Sequence[tuple[Array, Array]], *, closed: bool = False
    ) -> list[TrialCurve]:
        known = [(motion, *several) for motion, several in zip(motions, heights_of, strict=True)]

        def forces(force: _Force, heights: Array) -> list[Array]:
            return [force(motion, value @ heights, slope @ heights) for motion, value, slope in known]

        def change(force: _Force, heights: Array) -> Array | None:
            return screen.response_to_force(forces(force, heights))

        little, trials = 1e-6 * motions[0].inertia, []
        for of, force in _FORCES.items():
            of_unit = units.get(of, model.units.force)
            size = (
                float(np.sqrt(np.mean(np.concatenate(forces(force, np.full(len(knots) - closed, little))) ** 2)))
                / little
            )
            # An inertia does not drift. A force over the position is a trial of its own.
            excluded = (of, over) == ("inertia", "time") or (of == "force" and over != RECORD)
            if np.isfinite(size) and size > 0.0 and not excluded:
                step = 0.01 * screen.estimation.force / size
                trials.append(TrialCurve(of, of_unit, over, unit, knots, closed, step, partial(change, force)))
        return trials

    _, _, middle, span = screen.sizes.bodies[0]
    over, places = f"{model.bodies[0]}.position", [m.position for m in motions]
    if unit == "rad" and span > TURNS * 2.0 * np.pi:
        knots, places = np.linspace(0.0, 2.0 * np.pi, COEFFICIENT_KNOTS), [place % (2.0 * np.pi) for place in places]
        found = over_variable(f"{over} within a turn", unit, knots, places, closed=True)
    else:
        # A record has fewer samples at the ends of the travel than at any place of a turn.
        found = over_variable(over, unit, np.linspace(middle - 0.5 * span, middle + 0.5 * span, 9), places)
    if 1 < len(motions) <= MOST_RECORDS:
        own = np.eye(len(motions))
        ones = [np.ones((len(motion.time), 1)) for motion in motions]
        heights_of = [(one * row, 0.0 * one * row) for one, row in zip(ones, own, strict=True)]
        found += along(RECORD, "-", np.arange(1.0, len(motions) + 1.0), heights_of)
    if not any(_swept(motion) for motion in motions):
        # The records one after the other, without what lay between them.
        elapsed: list[Array] = []
        for motion in motions:
            elapsed.append(motion.time - motion.time[0] + (elapsed[-1][-1] if elapsed else 0.0))
        found += over_variable("time", "s", np.linspace(0.0, elapsed[-1][-1], TIME_KNOTS), elapsed)
    return found


def _swept(motion: PredictedMotion) -> bool:
    """Whether the frequency of a motion changes much with time, so that a slow drift and a resonance are confounded."""
    speed, acceleration, drive = (
        np.array([np.sqrt(np.mean(part**2)) for part in np.array_split(values, 8)])
        for values in (motion.velocity, motion.acceleration, motion.drive)
    )
    # At a small drive the frequency is that of noise.
    frequency = (acceleration / np.maximum(speed, 1e-300))[drive > 0.3 * np.max(drive)]
    return bool(len(frequency) > 1 and np.max(frequency) > 5.0 * np.min(frequency))
