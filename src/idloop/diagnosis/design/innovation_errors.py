"""Errors of a rival as the innovations of its observer."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from idloop.diagnosis.design.rival_noise import Noise, common_noise
from idloop.errors import IdloopError
from idloop.estimation.dataset import Data
from idloop.estimation.observer.innovations import MOST_EXPONENT, WALK, InnovationCriterion
from idloop.estimation.observer.stationary import discretise
from idloop.estimation.observer.time_varying import TimeVaryingObserver, time_varying_observer
from idloop.estimation.optimisation.caching_engine import CachingEngine

if TYPE_CHECKING:
    from idloop.diagnosis.design.experiment import Experiment
    from idloop.physics import Model
    from idloop.records import Record

Array = NDArray[np.float64]

# Decades by which a rival may take the disturbance for stronger, to explain with it what it misses.
_STRONGER = (2.0, 4.0, 6.0, 8.0)


class InnovationErrors:
    """Innovations of one rival, for experiments of any length; the noise is common to all rivals."""

    def __init__(self, model: Model, data: list[Data], noise: Noise) -> None:
        self.noise, self.model = noise, model
        self.engine = engine = CachingEngine(model)
        criterion = InnovationCriterion(engine, data, noise.sensors, noise.force, noise.exponent)
        self._measured = criterion.measured
        # A rival that fits worse has taken more for noise, and knows its parameters less well.
        self._own = common_noise([model], data)
        self._criterion = criterion
        self._criterion.keep(np.array([self._own.exponent, WALK]))
        self._linear = engine.linearise(None)
        chain = engine.layout(None).body_of
        own = 3.0 * np.max(criterion.initial.scale.reshape(-1, criterion.initial.width), axis=0)
        self._longest = max(float(d.time[-1] - d.time[0]) for d in data)
        n = len(chain)
        halves = np.diff([*chain, len(self._linear.A) // 2])
        self._spread = np.concatenate([np.repeat(own[:n], halves), np.repeat(own[n : 2 * n], halves), own[2 * n :]])
        self._known: dict[tuple[int, float], TimeVaryingObserver] = {}
        self._scalings: dict[tuple[int, float], list[Array]] = {}
        self._covariances: dict[float, list[Array]] = {}
        m = len(self._linear.A)
        augmented, self._process = np.zeros((m + 1, m + 1)), np.zeros((m + 1, m + 1))
        augmented[:m, :m], augmented[:m, m] = self._linear.A, self._linear.G
        self._process[m, m] = noise.intensity
        self._transition, self._process = discretise(augmented, self._process, noise.sample_time)
        self._output = np.hstack([self._linear.C, np.zeros((len(self._linear.C), 1))])

    @property
    def stronger(self) -> tuple[float, ...]:
        """Decades by which the disturbance may be taken for stronger than it is."""
        return tuple(decades for decades in _STRONGER if self.noise.exponent + decades <= MOST_EXPONENT)

    @property
    def period(self) -> int:
        """Every so many-th instant all outputs are measured."""
        return int(np.lcm.reduce(self.noise.every))

    def seen(self, theta: Array) -> Array:
        """Innovations on the data so far, white and of unit variance by this rival's own noise."""
        return self._own.scaled(self._criterion.errors(theta, np.array([self._own.exponent, WALK])))

    def errors(self, record: Record, start: float, theta: Array, decades: float = 0.0) -> Array:
        """Innovations on an experiment from rest at `start`, shape (n, p), NaN where nothing is measured."""
        noise, n = self.noise, len(self.model.bodies)
        output = record.output
        if any(step > 1 for step in noise.every):
            output = output.copy()
            for group, step in zip(noise.groups, noise.every, strict=True):
                skipped = np.arange(len(output)) % step != 0
                output[np.ix_(skipped, group)] = np.nan
        state = self.engine.initial_state(np.full(n, start), np.zeros(n), theta)
        gain = self._observer(len(record.time), decades).gain
        return self.engine.predict(
            theta, record.input_time, record.input, record.time, output, gain, initial_state=state
        )

    def shapes(self, samples: int) -> list[tuple[int, int]]:
        """Samples and outputs of each group in what `scaled` returns."""
        counts = [
            -(-samples // step) - own.whitener.order
            for step, own in zip(self.noise.every, self.noise.whitenings, strict=True)
        ]
        return [(max(count, 0), len(group)) for count, group in zip(counts, self.noise.groups, strict=True)]

    def differences(self, truth: Record, start: float, theta: Array, experiment: Experiment) -> dict[str, Any]:
        """Root mean square by output between the free runs of this rival and of the truth."""
        rival = experiment.run(self.model, engine=self.engine, theta=theta)
        left = np.sqrt(np.mean((rival.output - truth.output) ** 2, axis=0))
        return {
            output.name: {"value": float(value), "unit": output.unit, "noise": float(noise)}
            for output, value, noise in zip(self.model.outputs, left, self.noise.sensors, strict=True)
        }

    def _observer(self, samples: int, decades: float = 0.0) -> TimeVaryingObserver:
        """Observer for an experiment that takes the disturbance for stronger than it is."""
        key = (samples, decades)
        if key not in self._known:
            noise, intensity = self.noise, self.noise.intensity * 10.0**decades
            # No more of a constant force than the walk makes by itself: an offset is not noise.
            start = np.append(self._spread[:-1], np.sqrt(intensity * self._longest))
            observer = time_varying_observer(
                self._linear, self._measured, noise.sample_time, intensity, noise.sensors, start, samples
            )
            if not np.all(np.isfinite(observer.gain)):
                raise IdloopError("no observer could be designed for one of the rivals")
            self._known[key] = observer
        return self._known[key]

    def scaled(self, raw: Array, decades: float = 0.0) -> Array:
        """Series of innovations (n, p, k), white and of unit variance where the rival is right, shape (rows, k)."""
        noise, parts = self.noise, []
        starts = self._starts(len(raw), decades)
        for group, step, whitening, scaling in zip(noise.groups, noise.every, noise.whitenings, starts, strict=True):
            own = np.ascontiguousarray(raw[:, group])
            own[: len(scaling)] = scaling @ own[: len(scaling)]
            parts.append(whitening.columns(own[::step]))
        return np.concatenate(parts)

    def _starts(self, samples: int, decades: float) -> list[Array]:
        """What brings the first innovations, of a start that is uncertain, to the settled covariance, by group."""
        key = (samples, decades)
        if key not in self._scalings:
            covariance = self._observer(samples, decades).covariance[:samples]
            roots = [np.linalg.cholesky(covariance[:, group][:, :, group]) for group in self.noise.groups]
            self._scalings[key] = [np.asarray(root[-1] @ np.linalg.inv(root)) for root in roots]
        return self._scalings[key]

    def transferred(self, raw: Array, decades: float) -> Array:
        """Innovations (n, p, k) as those of an observer for a stronger disturbance."""
        given, wanted = self._observer(len(raw)).gain, self._observer(len(raw), decades).gain
        return np.asarray(transfer(*map(np.ascontiguousarray, (raw, self._transition, self._output, given, wanted))))

    def noise_at(self, decades: float) -> list[Array]:
        """Covariance by group of the innovations of such an observer, in units of that of the right one."""
        if decades not in self._covariances:
            right, stronger = self._stationary(0.0), self._stationary(decades)
            found = []
            for group in self.noise.groups:
                root = np.linalg.inv(np.linalg.cholesky(right[np.ix_(group, group)]))
                found.append(root @ stronger[np.ix_(group, group)] @ root.T)
            self._covariances[decades] = found
        return self._covariances[decades]

    def _stationary(self, decades: float) -> Array:
        """Innovation covariance of an observer for a stronger disturbance than there is, shape (p, p)."""
        gain = self._observer(max(samples for samples, _ in self._known), decades).gain
        transition, output = self._transition, self._output
        gain = gain[-len(transition) :]
        sensors = np.diag(self.noise.sensors**2)
        closed = transition @ (np.eye(len(transition)) - gain @ output)
        closed *= 1.0 - 1e-7  # an angle that no sensor shows keeps its error for ever
        covariance = self._process + transition @ gain @ sensors @ gain.T @ transition.T
        # Doubling: P = Σ Aᵏ Q Aᵏᵀ.
        for _ in range(60):
            grown = covariance + closed @ covariance @ closed.T
            closed = closed @ closed
            if np.allclose(grown, covariance, rtol=1e-9, atol=0.0):
                break
            covariance = grown
        return np.asarray(output @ covariance @ output.T + sensors)


@njit(cache=True, nogil=True, fastmath=False)
def transfer(innovations: Any, transition: Any, output: Any, given: Any, wanted: Any) -> Any:
    """Innovations (n, p, k) that another observer of the same linear model has, without running the model again.

    Both observers filter one difference between measurement and free run. Gains lie one below the other, shape
    (s m, p); the last is held.
    """
    n, p, series = innovations.shape
    m = transition.shape[0]
    last_given, last_wanted = given.shape[0] // m - 1, wanted.shape[0] // m - 1
    found = np.empty_like(innovations)
    # Difference between the states of the two observers, for every series.
    apart = np.zeros((m, series))
    moved = np.zeros((m, series))
    for t in range(n):
        at_given, at_wanted = m * min(t, last_given), m * min(t, last_wanted)
        for j in range(p):
            for s in range(series):
                value = innovations[t, j, s]
                for i in range(m):
                    value += output[j, i] * apart[i, s]
                found[t, j, s] = value
        for j in range(p):
            if np.isnan(innovations[t, j, 0]):
                continue
            for i in range(m):
                one, other = given[at_given + i, j], wanted[at_wanted + i, j]
                for s in range(series):
                    apart[i, s] += one * innovations[t, j, s] - other * found[t, j, s]
        for i in range(m):
            for s in range(series):
                moved[i, s] = 0.0
            for q in range(m):
                factor = transition[i, q]
                if factor != 0.0:
                    for s in range(series):
                        moved[i, s] += factor * apart[q, s]
        apart, moved = moved, apart
    return found
