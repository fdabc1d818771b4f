"""Free run of a model on a record, from the measured initial state.

Without a bound, least squares over the whole record starts an inadequate model far from where the machine was (a
position of -80 rad, a speed that the record never has), because a wrong start makes up for the model's errors later on.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from idloop.arrays import Array
from idloop.errors import IdloopError
from idloop.estimation.dataset import Data
from idloop.estimation.optimisation.levenberg import minimise
from idloop.estimation.sensors import body_sensors
from idloop.estimation.simulation import SimulationCriterion
from idloop.physics import Engine, Model

# Difference steps of the search, as a share of each state's typical size.
_STEP = 1e-5
# Samples that measure the initial state: a parabola in time through them.
_OPENING = 10
# The initial state lies within so many standard deviations of the measured one.
_REACH = 3.0


def free_run(engine: Engine, data: Data) -> Array:
    """Simulate a record's command from the measured initial position and velocity.

    They are those of least squares over the record, within three standard deviations of what its opening measures, so
    that sensor noise makes no drift; those of a body without a sensor are free.

    `engine`: model with the parameter values to use; only the initial state is fitted. `data`: record. Returns shape
    (n, p): simulated outputs at the record's times. Raises IdloopError: if the model cannot be simulated.
    """
    return _from_fitted_start(engine, data)[0]


def free_runs(engine: Engine, data: Data, other: Engine, *, moved: bool = False) -> tuple[Array, Array]:
    """Simulate a record with two models of the same bodies, both from the initial state of the first.

    `engine`, `other`: models that differ in what acts on the readings; only that then makes the runs differ. `moved`:
    let the other begin where its first reading of the position is the same. `data`: record. Returns shape (n, p):
    simulated outputs of both. Raises IdloopError: if the first model cannot be simulated.
    """
    simulated, start = _from_fitted_start(engine, data)
    rule, theta = SimulationCriterion(other, [data]), other.model.theta
    read = rule.simulated(theta, start, 0)
    if moved:
        apart = [
            (simulated[0, column] - read[0, column]) / output.scale
            for column, output in enumerate(other.model.outputs)
            if output.field == "position"
        ]
        start = start.copy()
        start[: len(other.model.bodies)] += max(apart, key=abs, default=0.0)
        read = rule.simulated(theta, start, 0)
    return simulated, read


def _from_fitted_start(engine: Engine, data: Data) -> tuple[Array, Array]:
    theta = engine.model.theta
    rule = SimulationCriterion(engine, [data])
    start, _, _, size = rule.nuisance()
    scale = np.asarray(size, dtype=float)
    columns = (column[np.isfinite(column)] for column in data.output.T)
    # An output that is constant or never measured sets no scale.
    spread = np.array([(float(np.std(known)) if len(known) else 0.0) or 1.0 for known in columns])

    def residual(nuisance: Array) -> Array:
        groups = rule.errors(theta, nuisance)
        parts = [(e / spread[group]).ravel() for group, (e,) in zip(rule.groups, groups, strict=True)]
        # In units of a hundredth of the signal, so that the search ends early enough.
        return 100.0 * np.concatenate(parts)

    base = residual(start)
    if not np.all(np.isfinite(base)):
        raise IdloopError(f"the free run of model {engine.model.name!r} does not stay finite")
    step = _STEP * scale
    slope = _slope(residual, start, base, step)
    lower, upper = _measured_range(engine, data, start)
    nearer = np.clip(start, lower, upper)
    if slope is not None:
        nearer = _gauss_newton_step(residual, nearer, start, base, slope, step, (lower, upper))
    # The Jacobian hardly changes, so that of the first step is reused.
    found = minimise(
        residual, nearer, lower, upper, scale, step=step, max_iterations=10, tolerance=1e-4, quick=True,
        jacobian=slope, draft=True,
    )  # fmt: skip
    return rule.simulated(theta, found.point, 0), found.point


def _measured_range(engine: Engine, data: Data, start: Array) -> tuple[Array, Array]:
    """Lower and upper bounds of the initial positions and velocities; infinite where nothing measures them.

    A sensor with an effect of its own, such as play or an offset, does not read the state.
    """
    model, bodies = engine.model, len(engine.model.bodies)
    altered = {i for i, output in enumerate(model.outputs) if output.site in {one.at for one in model.effects}}
    lower, upper = np.full(len(start), -np.inf), np.full(len(start), np.inf)
    for body, (place, speed) in enumerate(body_sensors(model)):
        estimates: dict[int, list[tuple[float, float]]] = {body: [], bodies + body: []}
        if place is not None and place not in altered:
            position, velocity = _opening(model, data, place)
            estimates[body].append(position)
            estimates[bodies + body].append(velocity)
        if speed is not None and speed not in altered:
            estimates[bodies + body].append(_opening(model, data, speed)[0])
        for state, found in estimates.items():
            known = [one for one in found if np.all(np.isfinite(one))]
            if known:
                value, spread = min(known, key=lambda one: one[1])
                lower[state], upper[state] = value - _REACH * spread, value + _REACH * spread
    return lower, upper


def _opening(model: Model, data: Data, column: int) -> tuple[tuple[float, float], tuple[float, float]]:
    """Value and rate of an output at the first sample with their standard deviations; NaN where it is not measured."""
    output = model.outputs[column]
    y = data.output[:, column] / output.scale
    known = np.flatnonzero(np.isfinite(y))[:_OPENING]
    if len(known) < 4 or known[0] >= _OPENING:
        return (np.nan, np.nan), (np.nan, np.nan)
    elapsed = data.time[known] - data.time[0]
    span = float(elapsed[-1])
    basis = np.vander(elapsed / span, 5, increasing=True)
    parabola = basis[:, :3]
    fitted, *_ = np.linalg.lstsq(parabola, y[known], rcond=None)
    error = float(np.linalg.norm(y[known] - parabola @ fitted)) / np.sqrt(len(known) - 3)
    # A reading is uncertain by its noise and by its resolution, which a standing body does not show.
    steps = np.abs(np.diff(y[np.isfinite(y)]))
    resolution = float(np.min(steps[steps > 0.0], initial=np.inf))
    least = max(
        (output.noise or 0.0) / abs(output.scale), resolution / np.sqrt(12.0) if np.isfinite(resolution) else 0.0
    )
    spread = max(error, least) * np.sqrt(np.diag(np.linalg.inv(parabola.T @ parabola)))
    # A vibration is no parabola: what a curve of the fourth degree has otherwise is uncertain as well.
    finer, *_ = np.linalg.lstsq(basis, y[known], rcond=None)
    spread = np.hypot(spread, (finer - np.append(fitted, [0.0, 0.0]))[:3])
    return (float(fitted[0]), float(spread[0])), (float(fitted[1]) / span, float(spread[1]) / span)


def _slope(residual: Callable[[Array], Array], start: Array, base: Array, step: Array) -> Array | None:
    """Derivative of the residual by the initial state, by differences; None where it does not stay finite."""
    columns = []
    for index, size in enumerate(step):
        moved = start.copy()
        moved[index] += size
        columns.append((residual(moved) - base) / size)
    slope = np.column_stack(columns)
    return slope if np.all(np.isfinite(slope)) else None


def _gauss_newton_step(
    residual: Callable[[Array], Array],
    nearest: Array,
    start: Array,
    base: Array,
    slope: Array,
    step: Array,
    bounds: tuple[Array, Array],
) -> Array:
    """One undamped Gauss-Newton step, the solution for a linear model; `nearest` to the start where that is better."""
    # In units of the typical change, so that a poorly observable state is left where it is.
    point = np.clip(start + step * np.linalg.lstsq(slope * step, -base, rcond=1e-9)[0], *bounds)
    there, here = residual(point), residual(nearest)
    return point if float(there @ there) < float(here @ here) else nearest
