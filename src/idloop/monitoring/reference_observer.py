"""The observer through which a machine is watched: its gain, the colour of its innovations, the steps of its slopes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from idloop.errors import IdloopError
from idloop.estimation.dataset import Data, force_scale, output_noise
from idloop.estimation.optimisation.problem import Problem
from idloop.estimation.prediction import PredictionCriterion
from idloop.estimation.statistics.whitening import Whitener, fit_whitener

if TYPE_CHECKING:
    from idloop.physics import Engine
    from idloop.physics.engine import Engine as CompiledEngine

Array = NDArray[np.float64]

# Samples of the reference from which observer and colour are found.
_ENOUGH = 60_000
# Longest time that an observer may take to forget its start [s]: each stretch of data loses as much.
_MOST_MEMORY = 20.0
_ROUNDS = 2  # the first compares raw innovations, the second whitened ones


@dataclass(frozen=True)
class Lens:
    """A stationary observer of the model with what is normal about its innovations.

    Attributes
    ----------
    gain : array, shape (2 b + 1, p)
        Observer gain.
    memory : int
        Samples after which the observer has forgotten its start.
    sample_time : float
        For which it was designed [s].
    groups : tuple of tuple of int
        Outputs that are measured at the same instants.
    whiteners : tuple of Whitener
        Of each group.
    weights : tuple of array, shape (g, g)
        Bring what is left of each group to unit covariance.
    """

    gain: Array
    memory: int
    sample_time: float
    groups: tuple[tuple[int, ...], ...]
    whiteners: tuple[Whitener, ...]
    weights: tuple[Array, ...]

    def look(self, innovations: Array, group: int, rows: NDArray[np.bool_]) -> Array:
        """Innovations of one group, white and of unit variance.

        Parameters
        ----------
        innovations : array, shape (n, p)
        group : int
        rows : array of bool, shape (n,)
            Those that count.

        Returns
        -------
        array, shape (m − order, g)
            Of the m rows that count, without the first ones, which have no full past.
        """
        part = np.ascontiguousarray(innovations[rows][:, list(self.groups[group])])
        return np.asarray(self.whiteners[group].apply(part) @ self.weights[group].T)

    def settled(self, data: Data, group: int) -> NDArray[np.bool_]:
        """Rows at which a group is measured and the observer has forgotten its start, shape (n,)."""
        keep = np.all(np.isfinite(data.output[:, list(self.groups[group])]), axis=1)
        for start in (0, *data.gaps):
            keep[start : start + self.memory] = False
        return np.asarray(keep)


def grind(engine: Engine | CompiledEngine, data: Sequence[Data], theta: Array) -> Lens:
    """Observer and noise model that suit healthy records.

    The disturbance's intensity is the one that makes the innovations likeliest, as in a fit by the prediction
    criterion; it is raised where the observer would take too long to forget its start.

    Parameters
    ----------
    engine : Engine
    data : sequence of Data
    theta : array, shape (k,)
        Free parameters.

    Raises
    ------
    IdloopError
        No observer can be designed.
    """
    short = _shortened(list(data))
    rule = PredictionCriterion(engine, short, output_noise(engine.model, short), force_scale(engine, short))
    for _ in range(_ROUNDS):
        rule.retune(theta)
    intensity = rule.intensity
    while rule.observer.memory * rule.sample_time > _MOST_MEMORY and intensity < 1e12 * rule.intensity:
        intensity *= 4.0
        rule.fix(theta, intensity)
    if not np.isfinite(rule.observer.memory):
        raise IdloopError("the observer never forgets its start: an unmeasured motion of this model is not stable")
    problem = Problem(rule, len(theta))
    point = np.concatenate([theta, rule.nuisance()[0]])
    problem.reweigh(point, whiten=True)
    errors = problem.errors(point)
    return Lens(
        gain=rule.observer.gain,
        memory=int(np.ceil(rule.observer.memory)),
        sample_time=rule.sample_time,
        groups=tuple(tuple(group) for group in rule.groups),
        whiteners=tuple(fit_whitener(group, order) for group, order in zip(errors, problem.orders, strict=True)),
        weights=tuple(problem.weights),
    )


def _shortened(data: list[Data]) -> list[Data]:
    """The first samples of the records, as many as are enough."""
    from dataclasses import replace

    share = _ENOUGH / sum(len(d.time) for d in data)
    if share >= 1.0:
        return data
    found = []
    for d in data:
        count = max(int(share * len(d.time)), min(len(d.time), 1000))
        found.append(replace(d, time=d.time[:count], output=d.output[:count], gaps=d.gaps[d.gaps < count]))
    return found
