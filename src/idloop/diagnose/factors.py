"""Coefficients that may not be constant: inertia, friction or drive as a learnt curve over position or time.

A machine whose inertia changes over the turn, whose friction falls as it warms, or whose motor is weaker at some angles
lacks a force that is no curve over one variable: it is one times the acceleration, the speed or the command.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from idloop.diagnose.predicted_motion import PredictedMotion, predicted_motion
from idloop.diagnose.shape import Shape

if TYPE_CHECKING:
    from idloop.diagnose.screen import Screen

Array = NDArray[np.float64]

# Knots over the travel, within a turn, and over the time, with which a machine drifts and does not jump.
_KNOTS, _KNOTS_OF_A_TURN, _KNOTS_OF_TIME = 9, 13, 5
# Turns from which on a coefficient is one over the turn, not over the travel.
_TURNS = 1.5
# Stretches of a record of which frequencies are compared, part of the strongest drive in one that is driven, and ratio
# of their frequencies in a sweep.
_STRETCHES, _DRIVEN, _SWEPT = 8, 0.3, 5.0
# Height of a trial curve, as a part of the typical force of the drive.
_STEP = 0.01


# Least inertia that a curve may leave, as a part of the model's: none is below nothing.
_LEAST_INERTIA = 0.1


@dataclass(frozen=True)
class _Factor:
    """A coefficient, and the force that a change of it makes, of the motion, the change and its slope."""

    of: str
    unit: Callable[[Screen], str]
    force: Callable[[PredictedMotion, Array, Array], Array]
    with_time: bool = True


def _of_inertia(motion: PredictedMotion, change: Array, slope: Array) -> Array:
    """What stores kinetic energy takes a force at constant speed as well where it changes (Lagrange's equation)."""
    turning = -0.5 * slope * motion.velocity**2
    inertia = np.maximum(motion.inertia + change, _LEAST_INERTIA * motion.inertia)
    return np.asarray(turning - change * (motion.inertia * motion.acceleration + turning) / inertia)


# What resists motion counts against it: a positive curve is more inertia, more friction, a stronger drive.
_FACTORS = (
    _Factor("inertia", lambda screen: screen.parent.model.units.inertia, _of_inertia, with_time=False),
    _Factor(
        "viscous friction",
        lambda screen: screen.parent.model.units.fill("{force}·s/{position}"),
        lambda motion, change, slope: -change * motion.velocity,
    ),
    _Factor(
        "dry friction",
        lambda screen: screen.parent.model.units.force,
        lambda motion, change, slope: -change * np.sign(motion.velocity),
    ),
    _Factor("drive", lambda screen: "-", lambda motion, change, slope: change * motion.drive),
)


def factor_shapes(screen: Screen) -> list[Shape]:
    """Every coefficient over the position of the driven body and over time.

    Parameters
    ----------
    screen : Screen
        Errors of the model.

    Returns
    -------
    list of Shape
        Empty where nothing predicts the motion, see `predicted_motion`. None over time where the command is a sweep.
    """
    motions = predicted_motion(screen.parent)
    if motions is None or not all(np.all(np.isfinite(m.position + m.acceleration)) for m in motions):
        return []
    model = screen.parent.model
    body, unit = model.bodies[0], model.units.position
    _, _, middle, span = screen.sizes.bodies[0]
    turn = 2.0 * np.pi if unit == "rad" else np.inf
    if span > _TURNS * turn:
        places = [np.asarray(m.position % turn) for m in motions]
        knots = np.linspace(0.0, turn, _KNOTS_OF_A_TURN)
        along = _Splines.at(places, knots, f"{body}.position within a turn", unit, closed=True)
    else:
        knots = np.linspace(middle - 0.5 * span, middle + 0.5 * span, _KNOTS)
        along = _Splines.at([m.position for m in motions], knots, f"{body}.position", unit)
    shapes = [_shape(screen, motions, factor, along) for factor in _FACTORS]
    if not any(_swept(motion) for motion in motions):
        elapsed = _elapsed(motions)
        by_time = _Splines.at(elapsed, np.linspace(0.0, float(elapsed[-1][-1]), _KNOTS_OF_TIME), "time", "s")
        shapes += [_shape(screen, motions, factor, by_time) for factor in _FACTORS if factor.with_time]
    return [shape for shape in shapes if shape is not None]


def _swept(motion: PredictedMotion) -> bool:
    """Whether the frequency of a motion changes much with time, so that nothing tells a slow drift from a resonance."""
    frequency, strength = [], []
    for rows in np.array_split(np.arange(len(motion.time)), _STRETCHES):
        speed = float(np.sqrt(np.mean(motion.velocity[rows] ** 2)))
        frequency.append(float(np.sqrt(np.mean(motion.acceleration[rows] ** 2))) / max(speed, 1e-300))
        strength.append(float(np.sqrt(np.mean(motion.drive[rows] ** 2))))
    # Where hardly anything drives the machine the frequency is that of noise.
    driven = np.array(frequency)[np.array(strength) > _DRIVEN * float(np.max(strength))]
    return bool(len(driven) > 1 and np.max(driven) > _SWEPT * np.min(driven))


def _elapsed(motions: Sequence[PredictedMotion]) -> list[Array]:
    """Seconds since the first record began, the records one after the other without what lay between them."""
    found, before = [], 0.0
    for motion in motions:
        own = motion.time - motion.time[0] + before
        found.append(np.asarray(own))
        before = float(own[-1])
    return found


@dataclass(frozen=True)
class _Splines:
    """Cubic splines, one for each height, at the places of every record: the same for all coefficients.

    Smooth, so that its slope, which an inertia's force has as well, does not jump at the knots.
    """

    over: str
    unit: str
    knots: Array
    closed: bool
    values: list[Array]
    slopes: list[Array]

    @classmethod
    def at(cls, places: Sequence[Array], knots: Array, over: str, unit: str, *, closed: bool = False) -> _Splines:
        from scipy.interpolate import CubicSpline

        hats = np.eye(len(knots))
        if closed:
            hats = np.vstack([hats[:-1, :-1], hats[:1, :-1]])
        curves = CubicSpline(knots, hats, bc_type="periodic" if closed else "natural")
        slopes = curves.derivative()
        inside = [np.clip(place, knots[0], knots[-1]) for place in places]
        return cls(over, unit, knots, closed, [curves(at) for at in inside], [slopes(at) for at in inside])


def _shape(screen: Screen, motions: Sequence[PredictedMotion], factor: _Factor, splines: _Splines) -> Shape | None:
    def push(heights: Array) -> list[Array]:
        return [
            factor.force(motion, values @ heights, slopes @ heights)
            for motion, values, slopes in zip(motions, splines.values, splines.slopes, strict=True)
        ]

    little = 1e-6 * motions[0].inertia
    level = np.full(splines.values[0].shape[1], little)
    size = float(np.sqrt(np.mean(np.concatenate(push(level)) ** 2))) / little
    if not (np.isfinite(size) and size > 0.0):
        return None
    return Shape(
        over=splines.over,
        unit=splines.unit,
        of=factor.of,
        of_unit=factor.unit(screen),
        knots=splines.knots,
        step=_STEP * screen.setting.force / size,
        change=lambda heights: screen.pushed(push(heights)),
        closed=splines.closed,
        coefficient=True,
    )
