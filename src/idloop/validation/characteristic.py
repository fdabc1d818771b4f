"""The characteristic of an effect: the data without its part of the model, and the fitted curve.

At a body it is the further force that the measured motion needs, at the input the command that acts, at a coupling the
torque that passes, at a sensor the error of the reading. The variable is the one that the fitted effect follows best,
so that a user's own effect has a characteristic as well.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from idloop.arrays import Array, Integers
from idloop.errors import IdloopError
from idloop.estimation.dataset import prepare
from idloop.estimation.force_balance.force_error import record_balance, thin
from idloop.estimation.optimisation.caching_engine import CachingEngine
from idloop.physics import Model
from idloop.physics.effect import BODY, COUPLING, INPUT, OUTPUT, Effect
from idloop.physics.kernel import GAIN
from idloop.physics.model import ActiveEffect
from idloop.records import Record
from idloop.validation.breakdown import sums
from idloop.validation.free_run import free_runs

# Bins of the mean, points of the curve.
_BINS, _CURVE = 24, 401
# The effect is a curve over a variable that explains this part of its variance.
_IS_CURVE = 0.9
# Parts below this one are negligible: of the command that an effect changes, and of rest within a filtered sample.
_NEGLIGIBLE = 0.1
_TURN, _PERIOD = "angle of the turn", "position within a period"


@dataclass(frozen=True)
class Characteristic:
    """Data without the effect over one variable, and the fitted effect."""

    variable: str
    unit: str
    quantity: str
    quantity_unit: str
    # Some points of the record.
    x: Array
    y: Array
    # Middle, mean and standard deviation of all points, by bin.
    centre: Array
    mean: Array
    band: Array
    # The fitted effect.
    curve_x: Array
    curve_y: Array
    # The variable is the angle of a turn [°].
    circular: bool


@np.errstate(over="ignore", invalid="ignore", divide="ignore")
def characteristic(model: Model, effect: str, record: Record) -> Characteristic | None:
    """Read the characteristic of ``effect@site`` of a fitted model off a record.

    None where the record does not show it: not every body is measured, the effect splits a body or makes the command
    late, or the free run of the model is lost. Raises InputError where the model has no such effect.
    """
    without = model.without_effect(effect)
    active = next(one for one in model.effects if one.name == effect)
    if active.effect.splits or shifts_in_time(active.effect):
        return None
    read = _of_a_force if model.site_kind(active.at) in {BODY, INPUT, COUPLING} else _of_a_reading
    try:
        return read(model, without, active, record)
    except IdloopError:
        return None


def shifts_in_time(effect: Effect) -> bool:
    """Whether an effect only delays the command, which has no characteristic over the command."""
    return effect.site == INPUT and effect.lags and not effect.lost_motion


def no_picture(effect: str, model: Model | None) -> str:
    """Why an effect has no characteristic, where it has none; `model` is the fitted one with it, if there is one."""
    active = None if model is None else next((one for one in model.effects if one.name == effect), None)
    if active is None:
        return "it was not fitted to this data"
    if shifts_in_time(active.effect):
        return "it shifts the command in time, which no curve over the motion shows"
    if active.effect.splits:
        return "it splits the body in two, of which one is not measured"
    if model is not None and model.site_kind(active.at) == OUTPUT:
        return "it changes the reading by less than a curve over the motion shows"
    return "the measurements do not determine its force"


def _of_a_force(model: Model, without: Model, active: ActiveEffect, record: Record) -> Characteristic | None:
    """Force, command or torque along the measured motion, in the band in which forces are compared."""
    data = prepare(model, [record])[0]
    engine, plain = CachingEngine(model), CachingEngine(without)
    balance = record_balance(engine, data)
    if balance is None:
        return None
    kind, motion, units = model.site_kind(active.at), balance.motion, model.units
    body = 0
    if kind != INPUT:
        body = model.bodies.index(active.at) if kind == BODY else model.couplings.index(active.at) + 1

    def unexplained(*along: Any, **conditions: Any) -> list[Array]:
        """Of the force on the body, without the effect and with it."""
        return [one.balance(None, *along, **conditions).residual[:, body] for one in (plain, engine)]

    command = balance.command.mean
    along = (motion.position, motion.velocity, motion.acceleration, motion.time, command, motion.time)
    lacking, left = unexplained(*along, conditions=balance.conditions)
    # Inertia times acceleration less the modelled forces is the force of the effect; shown is its negative, which the
    # drive must give.
    scale, offset, unit, quantity = -1.0, np.zeros(len(lacking)), units.force, "further force needed"
    over = {
        "velocity": (motion.velocity[:, body], f"{units.position}/s"),
        "position": (motion.position[:, body], units.position),
        "command": (command, model.input.unit),
    }
    if kind == INPUT:
        scale, unit = 1.0 / float(engine.layout(None).axis.constants[GAIN]), model.input.unit
        quantity = "change of the command"
        if float(np.max(np.abs(scale * (lacking - left)))) > _NEGLIGIBLE * float(np.max(np.abs(command))):
            offset, quantity = command, "command that acts"
        over = {name: over[name] for name in ("command", "velocity")}
    elif kind == COUPLING:
        twist, rate = (values[:, body - 1] - values[:, body] for values in (motion.position, motion.velocity))
        named = model.values
        offset = named[f"{active.at}.stiffness"] * twist + named.get(f"{active.at}.damping", 0.0) * rate
        scale, quantity = 1.0, "torque that passes" if units.position == "rad" else "force that passes"
        over = {"twist": (twist, units.position)}
    # At rest dry friction follows the command, not the motion.
    slow = np.abs(motion.velocity[:, body]) <= motion.rest_speed[body]
    stands = slow if active.effect.friction is not None else np.zeros_like(slow)
    fitted = offset + scale * (lacking - left)
    columns = [stands, offset + scale * lacking, fitted, *(values for values, _ in over.values())]
    kept = thin(np.column_stack(columns), motion)
    _, needed, fitted, *values = kept[kept[:, 0] < _NEGLIGIBLE].T
    over = {name: (x, of) for (name, (_, of)), x in zip(over.items(), values, strict=True)}
    period = model.values.get(f"{active.name}.period", np.inf)
    if kind == BODY and period < float(np.ptp(over["position"][0])):
        # What repeats along the travel is no curve over all of it: its periods lie on one another.
        over = {_PERIOD: (np.mod(over["position"][0], period), units.position), **over}

    def on_grid(variable: str, x: Array, x_unit: str) -> tuple[Array, Array]:
        """The effect over one variable while nothing else happens, with its corners."""
        x = np.linspace(np.min(x), np.max(x), _CURVE)
        position, velocity, still = np.zeros((3, _CURVE, len(model.bodies)))
        moved = {"position": position, "velocity": velocity}.get(variable)
        if moved is not None:
            moved[:, body] = np.radians(x) if x_unit == "°" else x
        # Dry friction at rest would balance the effect.
        velocity[velocity == 0.0] = 1e-12
        # Far enough apart for any delay in the model [s].
        sent = 10.0 * np.arange(_CURVE, dtype=np.float64)
        acting = x if variable == "command" else np.zeros(_CURVE)
        lacking, left = unexplained(position, velocity, still, sent, acting, sent + 9.0)
        return x, scale * (lacking - left) + (x if np.any(offset) else 0.0)

    remembers = active.effect.states > 0 or bool(active.effect.delay) or kind == COUPLING
    return _over_best_variable(over, needed, fitted, quantity, unit, None if remembers else on_grid)


def _of_a_reading(model: Model, without: Model, active: ActiveEffect, record: Record) -> Characteristic | None:
    """Error of a sensor against the reading of an ideal one of the same motion of the model."""
    data = prepare(model, [record])[0]
    column = next(i for i, output in enumerate(model.outputs) if output.site == active.at)
    output, measured = model.outputs[column], data.output[:, column]
    # One start for both, or the curve would shift or bend.
    both = free_runs(CachingEngine(model), data, CachingEngine(without))
    seen, true = (one[:, column] for one in both)
    known = np.isfinite(measured) & np.isfinite(true) & np.isfinite(seen)
    spread = float(np.std(measured[known]))
    # A free run that misses half of the motion does not show a sensor's error.
    if not spread > 0.0 or float(np.std((measured - seen)[known])) > 0.5 * spread:
        return None
    over = {
        output.field: (true[known], output.unit),
        f"rate of {output.field}": (np.gradient(true, data.time)[known], f"{output.unit}/s"),
    }
    fitted = (seen - true)[known]
    return _over_best_variable(over, (measured - true)[known], fitted, "reading, less the true value", output.unit)


def _over_best_variable(
    over: Mapping[str, tuple[Array, str]],
    data: Array,
    fitted: Array,
    quantity: str,
    quantity_unit: str,
    on_grid: Callable[[str, Array, str], tuple[Array, Array]] | None = None,
) -> Characteristic | None:
    """Over the first variable that the fitted effect follows within 2 % of the best."""
    if len(data) < _BINS or not np.any(fitted):
        return None
    variables: dict[str, tuple[Array, str]] = {}
    for name, (values, unit) in over.items():
        if name == "position" and unit == "rad" and float(np.ptp(values)) >= 2.0 * np.pi:
            # What repeats with every turn is a curve over the turn, a spring one over the position.
            variables[_TURN] = np.asarray(np.degrees(np.mod(values, 2.0 * np.pi))), "°"
        variables[name] = values, unit
    follows = {name: _follows(values, fitted) for name, (values, _) in variables.items()}
    name = next(name for name, share in follows.items() if share >= max(follows.values()) - 0.02)
    x, unit = variables[name]
    if follows[name] < _IS_CURVE:
        # An effect with memory: its path over a few loops from the middle of the record.
        first = max((len(x) - _CURVE) // 2, 0)
        curve = x[first : first + _CURVE], fitted[first : first + _CURVE]
    elif on_grid is None:
        curve = _bins(x, fitted, 4 * _BINS)[:2]
    else:
        curve = on_grid("position" if name in {_TURN, _PERIOD} else name, x, unit)
    some = np.unique(np.linspace(0, len(x) - 1, min(1500, len(x))).astype(np.int64))
    return Characteristic(
        name, unit, quantity, quantity_unit, x[some], data[some], *_bins(x, data, _BINS), *curve, unit == "°"
    )


def _follows(x: Array, y: Array) -> float:
    """Share of the power about the mean that a curve over x makes up; 1 of what never changes."""
    power = float(np.var(y))
    if not power > 1e-12 * float(np.mean(y**2)):
        return 1.0
    if not np.ptp(x) > 0.0:
        return 0.0
    _, number, mean, _ = sums(_bin_of(x, 2 * _BINS), y, 2 * _BINS)
    filled = number > 0.0
    return float(number[filled] @ (mean[filled] - float(np.mean(y))) ** 2) / power


def _bin_of(x: Array, count: int) -> Integers:
    low, high = float(np.min(x)), float(np.max(x))
    return np.minimum(((x - low) / max(high - low, 1e-300) * count).astype(np.int64), count - 1)


def _bins(x: Array, y: Array, count: int) -> tuple[Array, Array, Array]:
    """Middle, mean and standard deviation by bin, without nearly empty bins."""
    index = _bin_of(x, count)
    number = np.bincount(index, minlength=count)
    _, _, mean, rms = sums(index, y, count)
    middle = np.bincount(index, x, count) / np.maximum(number, 1)
    filled = number >= min(4, max(len(x) // (8 * count), 1))
    deviation = np.sqrt(np.maximum(rms**2 - mean**2, 0.0))
    return middle[filled], mean[filled], deviation[filled]
