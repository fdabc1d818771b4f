"""An effect's characteristic on the data that asked for it: what the model without it leaves, and the fitted curve.

At a body it is the further force that the measured motion needs, at the command the part of the command that acts,
at a coupling the torque that passes, at a sensor what the reading is off by. It is drawn over the variable that
the fitted effect follows best, so that an effect of the user's own has its picture as well.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from idloop.errors import IdloopError
from idloop.estimate.dataset import prepare
from idloop.estimate.engine import RememberingEngine
from idloop.estimate.force import Balance, balance_of, thin
from idloop.physics.effect import BODY, COUPLING, INPUT
from idloop.physics.kernel import GAIN
from idloop.validate.breakdown import sums
from idloop.validate.free_run import free_runs

if TYPE_CHECKING:
    from collections.abc import Callable

    from idloop.physics import Model
    from idloop.physics.effect import Effect
    from idloop.physics.model import ActiveEffect
    from idloop.records import Record

Array = NDArray[np.float64]

TURN = 2.0 * np.pi
# Points of the cloud, bins of its mean, points of the curve.
_DOTS, _BINS, _CURVE = 1500, 24, 401
# A bin with fewer points than this says nothing.
_FEWEST = 4
# The effect is a curve over a variable when that explains so much of its variance.
_IS_CURVE = 0.9
# Where the command's change is larger than this part of the command, the command that acts is the better picture.
_PLAIN = 0.1
# A speed that is none but counts as motion, in the unit of velocities.
_MOVING = 1e-12
# Between the points of a curve [s].
_APART = 10.0
# A filtered instant at which the body stands, by the part that the filter leaves of standing.
_STANDS = 0.1
# A free run that misses more than this part of the motion is no ground to read a sensor's error from.
_LOST = 0.5


@dataclass(frozen=True)
class Characteristic:
    """What the model without an effect leaves unexplained, over one variable, and the fitted effect.

    Attributes
    ----------
    effect : str
        ``effect@site``.
    variable, unit : str
        Of the horizontal axis.
    quantity, quantity_unit : str
        Of the vertical axis.
    x, y : array, shape (n,)
        Some points of the record.
    centre, mean, band : array, shape (k,)
        Bins of all points: middle, mean and standard deviation.
    curve_x, curve_y : array, shape (m,)
        The fitted effect.
    circular : bool
        The variable is the angle of a turn [°].
    share : float
        Share of the points' power that the fitted effect explains, at most 1; below 0 it does harm.
    """

    effect: str
    variable: str
    unit: str
    quantity: str
    quantity_unit: str
    x: Array
    y: Array
    centre: Array
    mean: Array
    band: Array
    curve_x: Array
    curve_y: Array
    circular: bool
    share: float

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON; the cloud of points is left out."""
        return {
            "effect": self.effect,
            "variable": self.variable,
            "unit": self.unit,
            "quantity": self.quantity,
            "quantity_unit": self.quantity_unit,
            "bins": {"centre": self.centre.tolist(), "mean": self.mean.tolist(), "deviation": self.band.tolist()},
            "curve": {"x": self.curve_x.tolist(), "y": self.curve_y.tolist()},
            "circular": self.circular,
            "share": self.share,
        }


@dataclass(frozen=True)
class _Cloud:
    """Data and fitted effect at the same instants, and the variables that they may be drawn over."""

    data: Array
    fitted: Array
    variables: dict[str, tuple[Array, str]]
    quantity: str
    unit: str
    # The effect itself over a variable (its values, its unit), where it remembers nothing: with its corners.
    on_grid: Callable[[str, Array, str], tuple[Array, Array]] | None = None


def characteristic(model: Model, effect: str, record: Record) -> Characteristic | None:
    """Read an effect's characteristic off a record.

    Parameters
    ----------
    model : Model
        Fitted, with the effect.
    effect : str
        ``effect@site`` of the model.
    record : Record

    Returns
    -------
    Characteristic or None
        None where the record does not show it: not every body is measured, the effect splits a body or makes the
        command late, or the free run of the model is lost.

    Raises
    ------
    InputError
        The model has no such effect.
    """
    without = model.without_effect(effect)
    active = next(one for one in model.effects if one.name == effect)
    kind = model.site_kind(active.at)
    if active.effect.splits or shifts_in_time(active.effect):
        return None
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        try:
            cloud = (_force_cloud if kind in {BODY, INPUT, COUPLING} else _reading_cloud)(
                model, without, active, record
            )
        except IdloopError:
            return None
    if cloud is None or len(cloud.data) < _BINS or not np.any(cloud.fitted):
        return None
    return _drawn(active, cloud)


def shifts_in_time(effect: Effect) -> bool:
    """Whether an effect only makes the command late: over the command that is the straight line of no effect."""
    return effect.site == INPUT and effect.lags and not effect.lost_motion


# ---------------------------------------------------------------- forces


def _force_cloud(model: Model, without: Model, active: ActiveEffect, record: Record) -> _Cloud | None:
    """Force, command or torque along the measured motion, in the band in which forces are compared."""
    data = prepare(model, [record])[0]
    engine, plain = RememberingEngine(model), RememberingEngine(without)
    balance = balance_of(engine, data)
    if balance is None:
        return None
    kind, motion = model.site_kind(active.at), balance.motion
    body = _body(model, active.at, kind)
    command = balance.command(0.0)
    lacking, left = (_left(one, balance, command)[:, body] for one in (plain, engine))
    # Inertia times acceleration less the modelled forces is what the effect exerts; of a drag one knows its opposite,
    # what the drive must give for it.
    scale, offset, unit, quantity = -1.0, np.zeros(len(lacking)), model.units.force, "further force needed"
    variables = {
        "velocity": (motion.velocity[:, body], f"{model.units.position}/s"),
        "position": (motion.position[:, body], model.units.position),
        "command": (command, model.input.unit),
    }
    if kind == INPUT:
        scale, unit = 1.0 / float(engine.layout(None).axis.constants[GAIN]), model.input.unit
        quantity = "change of the command"
        if float(np.max(np.abs(scale * (lacking - left)))) > _PLAIN * float(np.max(np.abs(command))):
            offset, quantity = command, "command that acts"
        variables = {name: variables[name] for name in ("command", "velocity")}
    elif kind == COUPLING:
        twist, rate = (values[:, body - 1] - values[:, body] for values in (motion.position, motion.velocity))
        named = model.values
        offset = named[f"{active.at}.stiffness"] * twist + named.get(f"{active.at}.damping", 0.0) * rate
        scale, quantity = 1.0, "torque that passes" if model.units.position == "rad" else "force that passes"
        variables = {"twist": (twist, model.units.position)}
    columns = [offset + scale * lacking, offset + scale * (lacking - left), *(x for x, _ in variables.values())]
    # What dry friction takes while the body stands is no level of it: it follows the command, not the motion.
    slow = np.abs(motion.velocity[:, body]) <= motion.rest_speed[body]
    stands = slow if active.effect.friction is not None else np.zeros_like(slow)
    stacked = thin(np.column_stack([*columns, stands]), motion)
    stacked = stacked[stacked[:, -1] < _STANDS]
    kept = {name: (stacked[:, 2 + i], of) for i, (name, (_, of)) in enumerate(variables.items())}
    plainly = active.effect.states == 0 and not active.effect.delay and kind != COUPLING

    def on_grid(variable: str, x: Array, x_unit: str) -> tuple[Array, Array]:
        change = _on_grid(engine, plain, body, variable, (float(np.min(x)), float(np.max(x))), x_unit)
        return change[0], scale * change[1] + (change[0] if np.any(offset) else 0.0)

    return _Cloud(stacked[:, 0], stacked[:, 1], kept, quantity, unit, on_grid if plainly else None)


def _on_grid(
    engine: RememberingEngine,
    plain: RememberingEngine,
    body: int,
    variable: str,
    reach: tuple[float, float],
    unit: str,
) -> tuple[Array, Array]:
    """Force of the effect over one variable while nothing else happens."""
    x = np.linspace(*reach, _CURVE)
    bodies = len(engine.model.bodies)
    motion = {name: np.zeros((_CURVE, bodies)) for name in ("position", "velocity")}
    if variable in motion:
        motion[variable][:, body] = np.radians(x) if unit == "°" else x
    # Dry friction of a body that stands takes what it needs, and would hide the effect.
    motion["velocity"][motion["velocity"] == 0.0] = _MOVING
    # Far enough apart that a delay elsewhere in the model does not mix them.
    sent: Array = _APART * np.arange(_CURVE, dtype=np.float64)
    told: Array = sent + 0.9 * _APART
    command = x if variable == "command" else np.zeros(_CURVE)
    still = np.zeros((_CURVE, bodies))
    lacking, left = (
        one.equation_error(None, motion["position"], motion["velocity"], still, sent, command, told)
        for one in (plain, engine)
    )
    return x, (lacking - left)[:, body]


def _left(engine: RememberingEngine, balance: Balance, command: Array) -> Array:
    m = balance.motion
    return engine.equation_error(
        None, m.position, m.velocity, m.acceleration, m.time, command, m.time, conditions=balance.conditions
    )


def _body(model: Model, at: str, kind: str) -> int:
    if kind == INPUT:
        return 0
    return model.bodies.index(at) if kind == BODY else model.couplings.index(at) + 1


# ---------------------------------------------------------------- readings


def _reading_cloud(model: Model, without: Model, active: ActiveEffect, record: Record) -> _Cloud | None:
    """What a sensor is off by, against the same motion of the model as a true sensor would show it."""
    data = prepare(model, [record])[0]
    column = next(i for i, output in enumerate(model.outputs) if output.site == active.at)
    # One start for both: another one would move the whole curve, or bend it.
    both = free_runs(RememberingEngine(model), data, RememberingEngine(without))
    seen, true = (one[:, column] for one in both)
    output, measured = model.outputs[column], data.output[:, column]
    known = np.isfinite(measured) & np.isfinite(true) & np.isfinite(seen)
    spread = float(np.std(measured[known]))
    if np.sum(known) < _BINS or not spread > 0.0:
        return None
    if float(np.std((measured - seen)[known])) > _LOST * spread:
        return None
    slope = np.gradient(true, data.time)
    variables = {
        output.field: (true[known], output.unit),
        f"rate of {output.field}": (slope[known], f"{output.unit}/s"),
    }
    return _Cloud(
        (measured - true)[known], (seen - true)[known], variables, "reading, less the true value", output.unit
    )


# ---------------------------------------------------------------- over one variable


def _drawn(active: ActiveEffect, cloud: _Cloud) -> Characteristic:
    variables = {name: _over_a_turn(name, *values) for name, values in cloud.variables.items()}
    follows = {name: _follows(x, cloud.fitted) for name, (x, _) in variables.items()}
    # Of variables that serve as well the first, which is the usual one.
    best = max(follows.values())
    name = next(name for name, share in follows.items() if share >= best - 0.02)
    x, unit = variables[name]
    circular = unit == "°"
    grid = cloud.on_grid(name, x, unit) if cloud.on_grid is not None and follows[name] >= _IS_CURVE else None
    curve_x, curve_y = grid or _curve(x, cloud.fitted, is_curve=follows[name] >= _IS_CURVE)
    centre, mean, band = _bins(x, cloud.data, _BINS)
    some = np.unique(np.linspace(0, len(x) - 1, min(_DOTS, len(x))).astype(np.int64))
    power = float(np.sum((cloud.data - np.mean(cloud.data)) ** 2))
    rest = cloud.data - cloud.fitted
    share = 1.0 - float(np.sum((rest - np.mean(rest)) ** 2)) / power if power > 0.0 else 0.0
    label = "angle of the turn" if circular else name
    return Characteristic(
        active.name, label, unit, cloud.quantity, cloud.unit, x[some], cloud.data[some],
        centre, mean, band, curve_x, curve_y, circular, share,
    )  # fmt: skip


def _over_a_turn(name: str, x: Array, unit: str) -> tuple[Array, str]:
    """Angle of the turn [°] of a motion over more than one."""
    if name == "position" and unit == "rad" and float(np.ptp(x)) >= TURN:
        return np.asarray(np.degrees(np.mod(x, TURN))), "°"
    return x, unit


def _follows(x: Array, y: Array) -> float:
    """Share of the power about the mean that a curve over x makes up; 1 of what never changes."""
    power = float(np.var(y))
    if not power > 1e-12 * float(np.mean(y**2)):
        return 1.0
    if not np.ptp(x) > 0.0:
        return 0.0
    _, number, mean, _ = sums(_index(x, 2 * _BINS), y, 2 * _BINS)
    filled = number > 0.0
    return float(number[filled] @ (mean[filled] - float(np.mean(y))) ** 2) / power


def _curve(x: Array, y: Array, *, is_curve: bool) -> tuple[Array, Array]:
    """The effect as a curve where it is one; its path over some time where it remembers."""
    if is_curve:
        centre, mean, _ = _bins(x, y, 4 * _BINS)
        return centre, mean
    # A few loops: from the middle of the record on.
    first = max((len(x) - _CURVE) // 2, 0)
    return x[first : first + _CURVE], y[first : first + _CURVE]


def _index(x: Array, count: int) -> NDArray[np.int64]:
    low, high = float(np.min(x)), float(np.max(x))
    return np.minimum(((x - low) / max(high - low, 1e-300) * count).astype(np.int64), count - 1)


def _bins(x: Array, y: Array, count: int) -> tuple[Array, Array, Array]:
    index = _index(x, count)
    number = np.bincount(index, minlength=count)
    _, _, mean, rms = sums(index, y, count)
    middle = np.bincount(index, x, count) / np.maximum(number, 1)
    filled = number >= min(_FEWEST, max(len(x) // (8 * count), 1))
    deviation = np.sqrt(np.maximum(rms**2 - mean**2, 0.0))
    return middle[filled], mean[filled], deviation[filled]
