"""Free run of a model on a record, from the initial state that suits the record best."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from idloop.errors import IdloopError
from idloop.estimate.levenberg import minimise
from idloop.estimate.simulation import SimulationCriterion

if TYPE_CHECKING:
    from idloop.estimate.dataset import Data
    from idloop.physics import Engine

Array = NDArray[np.float64]


def free_run(engine: Engine, data: Data) -> Array:
    """Simulate a record's command from an estimated initial position and velocity.

    Parameters
    ----------
    engine : Engine
        Model with the values of its file; nothing but the initial state is fitted.
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
    theta = engine.model.theta
    rule = SimulationCriterion(engine, [data])
    start, lower, upper, scale = rule.nuisance()
    columns = (column[np.isfinite(column)] for column in data.output.T)
    # An output that is constant or never measured sets no scale.
    spread = np.array([(float(np.std(known)) if len(known) else 0.0) or 1.0 for known in columns])

    def residual(nuisance: Array) -> Array:
        groups = rule.errors(theta, nuisance)
        parts = [(e / spread[group]).ravel() for group, (e,) in zip(rule.groups, groups, strict=True)]
        # Units of a hundredth of the signal: the search ends where the start no longer matters.
        return 100.0 * np.concatenate(parts)

    if not np.all(np.isfinite(residual(start))):
        raise IdloopError(f"the free run of model {engine.model.name!r} does not stay finite")
    found = minimise(residual, start, lower, upper, scale, max_iterations=10, tolerance=1e-6)
    return rule.simulated(theta, found.point, 0)
