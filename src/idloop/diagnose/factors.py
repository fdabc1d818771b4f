"""Coefficients that may not be constant: inertia, friction or drive as a learnt curve over position or time.

A machine whose inertia changes over the turn, whose friction falls as it warms, or whose motor is weaker at some angles
lacks a force that is no curve over one variable: it is one times the acceleration, the speed or the command.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from idloop.diagnose.curves import Shape
from idloop.diagnose.predicted_motion import PredictedMotion, predicted_motion
from idloop.diagnose.unknown import COEFFICIENT_KNOTS, TIME_KNOTS, TURNS, coefficient_units

if TYPE_CHECKING:
    from idloop.diagnose.screen import Screen

Array = NDArray[np.float64]
# The force that a change of a coefficient makes, by the motion, the change and its slope along the position.
_Force = Callable[[PredictedMotion, Array, Array], Array]

# Over the travel, of which a record sees the ends less often than every place of a turn.
_TRAVEL_KNOTS = 9
# Stretches of a record of which frequencies are compared, part of the strongest drive in one that is driven, and ratio
# of their frequencies in a sweep.
_STRETCHES, _DRIVEN, _SWEPT = 8, 0.3, 5.0


def _of_inertia(motion: PredictedMotion, change: Array, slope: Array) -> Array:
    """What stores kinetic energy takes a force at constant speed as well where it changes (Lagrange's equation)."""
    turning = -0.5 * slope * motion.velocity**2
    # None is below nothing.
    inertia = np.maximum(motion.inertia + change, 0.1 * motion.inertia)
    return np.asarray(turning - change * (motion.inertia * motion.acceleration + turning) / inertia)


# What resists motion counts against it: a positive curve is more inertia, more friction, a stronger drive.
_FORCES: dict[str, _Force] = {
    "inertia": _of_inertia,
    "viscous friction": lambda motion, change, slope: -change * motion.velocity,
    "dry friction": lambda motion, change, slope: -change * np.sign(motion.velocity),
    "drive": lambda motion, change, slope: change * motion.drive,
}


def factor_shapes(screen: Screen) -> list[Shape]:
    """Every coefficient over the position of the driven body and, but for the inertia, over time.

    Empty where nothing predicts the motion, see `predicted_motion`. None over time where the command is a sweep.
    """
    motions = predicted_motion(screen.parent)
    if motions is None or not all(np.all(np.isfinite(m.position + m.acceleration)) for m in motions):
        return []
    model = screen.parent.model
    over, unit, units = f"{model.bodies[0]}.position", model.units.position, coefficient_units(model.units)
    _, _, middle, span = screen.sizes.bodies[0]
    turn = 2.0 * np.pi if unit == "rad" else np.inf
    places, turning = [m.position for m in motions], span > TURNS * turn
    knots = np.linspace(middle - 0.5 * span, middle + 0.5 * span, _TRAVEL_KNOTS)
    if turning:
        places, knots, over = (
            [p % turn for p in places],
            np.linspace(0.0, turn, COEFFICIENT_KNOTS),
            f"{over} within a turn",
        )
    shapes = _shapes(screen, motions, units, over, unit, knots, places, closed=turning)
    if not any(_swept(motion) for motion in motions):
        # The records one after the other, without what lay between them.
        elapsed: list[Array] = []
        for motion in motions:
            elapsed.append(motion.time - motion.time[0] + (elapsed[-1][-1] if elapsed else 0.0))
        del units["inertia"]
        shapes += _shapes(screen, motions, units, "time", "s", np.linspace(0.0, elapsed[-1][-1], TIME_KNOTS), elapsed)
    return shapes


def _swept(motion: PredictedMotion) -> bool:
    """Whether the frequency of a motion changes much with time, so that nothing tells a slow drift from a resonance."""
    speed, acceleration, drive = (
        np.array([np.sqrt(np.mean(part**2)) for part in np.array_split(values, _STRETCHES)])
        for values in (motion.velocity, motion.acceleration, motion.drive)
    )
    # Where hardly anything drives the machine the frequency is that of noise.
    frequency = (acceleration / np.maximum(speed, 1e-300))[drive > _DRIVEN * np.max(drive)]
    return bool(len(frequency) > 1 and np.max(frequency) > _SWEPT * np.min(frequency))


def _shapes(
    screen: Screen,
    motions: Sequence[PredictedMotion],
    units: dict[str, str],
    over: str,
    unit: str,
    knots: Array,
    places: Sequence[Array],
    *,
    closed: bool = False,
) -> list[Shape]:
    """Coefficients over one variable, as cubic splines at the places of every record.

    Smooth, so that its slope, which an inertia's force has as well, does not jump at the knots.
    """
    from scipy.interpolate import CubicSpline

    hats = np.eye(len(knots))
    if closed:
        hats = np.vstack([hats[:-1, :-1], hats[:1, :-1]])
    splines = CubicSpline(knots, hats, bc_type="periodic" if closed else "natural")
    slopes = splines.derivative()
    inside = [np.clip(place, knots[0], knots[-1]) for place in places]
    along = [(motion, splines(at), slopes(at)) for motion, at in zip(motions, inside, strict=True)]

    def push(force: _Force, heights: Array) -> list[Array]:
        return [force(motion, value @ heights, slope @ heights) for motion, value, slope in along]

    def change(force: _Force, heights: Array) -> Array | None:
        return screen.pushed(push(force, heights))

    little, shapes = 1e-6 * motions[0].inertia, []
    for of, of_unit in units.items():
        force = _FORCES[of]
        size = float(np.sqrt(np.mean(np.concatenate(push(force, np.full(hats.shape[1], little))) ** 2))) / little
        if np.isfinite(size) and size > 0.0:
            step = 0.01 * screen.setting.force / size
            shapes.append(Shape(of, of_unit, over, unit, knots, closed, step, partial(change, force)))
    return shapes
