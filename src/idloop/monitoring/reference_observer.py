"""The stationary observer of a monitor, with the noise model of its innovations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from idloop.arrays import Array, Mask
from idloop.errors import IdloopError
from idloop.estimation.dataset import Data, force_scale, output_noise
from idloop.estimation.likelihood.disturbance import fit_random_walk
from idloop.estimation.observer.innovations import WALK, InnovationCriterion
from idloop.estimation.observer.stationary import Observer, design
from idloop.estimation.optimisation.least_squares import LeastSquaresProblem
from idloop.estimation.statistics.whitening import Whitener, fit_whitener

if TYPE_CHECKING:
    from idloop.physics import Engine
    from idloop.physics.engine import Engine as CompiledEngine


# Most samples of the reference from which observer and noise model are designed.
_ENOUGH = 60_000
# Longest settling time of the observer [s], which each stretch of data loses.
_MOST_MEMORY = 20.0
_MOST_RAISE = 12.0  # decades by which the disturbance may be raised for that


@dataclass(frozen=True)
class ReferenceObserver:
    """A stationary observer and the noise model of its innovations on the healthy machine."""

    gain: Array  # shape (2 b + 1, p): observer gain
    memory: int  # samples that the observer takes to settle
    sample_time: float  # sample time of the design [s]
    groups: tuple[tuple[int, ...], ...]  # outputs measured at the same instants
    whiteners: tuple[Whitener, ...]  # one for each group
    weights: tuple[Array, ...]  # shape (g, g): scale the whitened innovations of each group to unit covariance

    def whitened(self, innovations: Array, group: int, rows: Mask) -> Array:
        """Innovations of one group, white and of unit variance.

        `innovations` (n, p); `rows` (n,): rows to use. Returns shape (m − order, g): of the m rows, without the first
        ones, whose past is incomplete.
        """
        part = np.ascontiguousarray(innovations[rows][:, list(self.groups[group])])
        return np.asarray(self.whiteners[group].apply(part) @ self.weights[group].T)

    def settled(self, data: Data, group: int) -> Mask:
        """Rows in which a group is measured and the observer has settled, shape (n,)."""
        keep = np.all(np.isfinite(data.output[:, list(self.groups[group])]), axis=1)
        for start in (0, *data.gaps):
            keep[start : start + self.memory] = False
        return np.asarray(keep)


def design_reference_observer(engine: Engine | CompiledEngine, data: Sequence[Data], theta: Array) -> ReferenceObserver:
    """Design the observer and its noise model on healthy records.

    The disturbance intensity maximises the likelihood, as in a fit by the prediction criterion; it is raised where
    the observer would settle too slowly.

    `theta` (k,): free parameters. Raises IdloopError: no observer can be designed.
    """
    short = _shortened(list(data))
    noise = output_noise(engine.model, short)
    rule = InnovationCriterion(engine, short, noise, force_scale(engine, short))
    first = exponent = fit_random_walk(rule, theta, whiten=True)
    sample_time, used = float(np.median([d.sample_time for d in short])), rule.measured
    linear = engine.linearise(theta)

    def stationary(exponent: float) -> Observer:
        return design(linear.A, linear.C[used], linear.G, sample_time, rule.unit * 10.0**exponent, noise[used])

    observer = stationary(exponent)
    while observer.memory * sample_time > _MOST_MEMORY and exponent < first + _MOST_RAISE:
        exponent += np.log10(4.0)
        observer = stationary(exponent)
    if not np.isfinite(observer.memory):
        raise IdloopError("the observer does not settle: an unmeasured motion of this model is not stable")
    gain = np.zeros((len(observer.gain), len(noise)))
    gain[:, used] = observer.gain
    problem = LeastSquaresProblem(rule, len(theta))
    point = np.append(theta, (exponent, WALK))
    problem.reweigh(point, whiten=True)
    errors = problem.errors(point)
    return ReferenceObserver(
        gain=gain,
        memory=int(np.ceil(observer.memory)),
        sample_time=sample_time,
        groups=tuple(tuple(group) for group in rule.groups),
        whiteners=tuple(fit_whitener(group, order) for group, order in zip(errors, problem.orders, strict=True)),
        weights=tuple(problem.weights),
    )


def _shortened(data: list[Data]) -> list[Data]:
    """The first samples of each record, in all not much more than `_ENOUGH`."""
    share = _ENOUGH / sum(len(d.time) for d in data)
    if share >= 1.0:
        return data
    found = []
    for d in data:
        count = max(int(share * len(d.time)), min(len(d.time), 1000))
        found.append(d.part(0, count, all_commands=True))
    return found
