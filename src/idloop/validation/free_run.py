"""Free run of a model on a record, from the least-squares initial state."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from idloop.errors import IdloopError
from idloop.estimation.optimisation.levenberg import minimise
from idloop.estimation.simulation import SimulationCriterion

if TYPE_CHECKING:
    from idloop.estimation.dataset import Data
    from idloop.physics import Engine

Array = NDArray[np.float64]

# Difference steps of the search, as a share of each state's typical size.
_STEP = 1e-5


def free_run(engine: Engine, data: Data) -> Array:
    """Simulate a record's command from an estimated initial position and velocity.

    Parameters
    ----------
    engine : Engine
        Model with the parameter values to use; only the initial state is fitted.
    data : Data
        Record.

    Returns
    -------
    array, shape (n, p)
        Simulated outputs at the record's times.

    Raises
    ------
    IdloopError
        If the model cannot be simulated.
    """
    return _from_fitted_start(engine, data)[0]


def free_runs(engine: Engine, data: Data, other: Engine) -> tuple[Array, Array]:
    """Simulate a record with two models of the same bodies, both from the least-squares initial state of the first.

    Parameters
    ----------
    engine, other : Engine
        Models that differ in what acts on the readings; only that then makes the runs differ.
    data : Data
        Record.

    Returns
    -------
    tuple of array, shape (n, p)
        Simulated outputs of both.

    Raises
    ------
    IdloopError
        If the first model cannot be simulated.
    """
    simulated, start = _from_fitted_start(engine, data)
    return simulated, SimulationCriterion(other, [data]).simulated(other.model.theta, start, 0)


def _from_fitted_start(engine: Engine, data: Data) -> tuple[Array, Array]:
    theta = engine.model.theta
    rule = SimulationCriterion(engine, [data])
    start, lower, upper, size = rule.nuisance()
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
    nearer, slope = _gauss_newton_step(residual, start, base, step)
    # The Jacobian hardly changes, so that of the first step is reused.
    found = minimise(
        residual, nearer, lower, upper, scale, step=step, max_iterations=10, tolerance=1e-4, quick=True,
        jacobian=slope, draft=True,
    )  # fmt: skip
    return rule.simulated(theta, found.point, 0), found.point


def _gauss_newton_step(
    residual: Callable[[Array], Array], start: Array, base: Array, step: Array
) -> tuple[Array, Array | None]:
    """One undamped Gauss-Newton step, the solution for a linear model; the start where it is worse."""
    columns = []
    for index, size in enumerate(step):
        moved = start.copy()
        moved[index] += size
        columns.append((residual(moved) - base) / size)
    slope = np.column_stack(columns)
    if not np.all(np.isfinite(slope)):
        return start, None
    # In units of the typical change, so that a poorly observable state is left where it is.
    move = step * np.linalg.lstsq(slope * step, -base, rcond=1e-9)[0]
    there = residual(start + move)
    return (start + move if float(there @ there) < float(base @ base) else start), slope
