"""Rivals held against an experiment by the innovations of their observers."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from idloop.diagnosis.design.common_noise import Noise, common_noise
from idloop.diagnosis.design.rival_view import Difference
from idloop.diagnosis.design.transfer import transfer
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


class PredictionView:
    """One rival seen through its observer, for experiments of any length.

    Parameters
    ----------
    model : Model
    data : list of Data
        The data so far.
    noise : Noise
        Common to all rivals.
    """

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
    def stronger(self) -> list[float]:
        """Decades by which the disturbance may be taken for stronger than it is."""
        return [decades for decades in _STRONGER if self.noise.exponent + decades <= MOST_EXPONENT]

    @property
    def period(self) -> int:
        """Every so many-th instant all outputs are measured."""
        return int(np.lcm.reduce(self.noise.every))

    def seen(self, theta: Array) -> Array:
        """Innovations on the data so far, white and of unit variance by this rival's own noise."""
        return self._own.scaled(self._criterion.errors(theta, np.array([self._own.exponent, WALK])))

    def innovations(self, record: Record, start: float, theta: Array, decades: float = 0.0) -> Array:
        """Innovations of the observer on an experiment, shape (n, p), NaN where nothing is measured.

        Parameters
        ----------
        record : Record
        start : float
            Where the axis rested before [position unit].
        theta : array, shape (k,)
        decades : float
            By which the observer takes the disturbance for stronger than it is.
        """
        noise, n = self.noise, len(self.model.bodies)
        output = record.output
        if any(step > 1 for step in noise.every):
            output = output.copy()
            for group, step in zip(noise.groups, noise.every, strict=True):
                skipped = np.arange(len(output)) % step != 0
                output[np.ix_(skipped, group)] = np.nan
        state = self.engine.initial_state(np.full(n, start), np.zeros(n), theta)
        gain = self.of(len(record.time), decades).gain
        return self.engine.predict(
            theta, record.input_time, record.input, record.time, output, gain, initial_state=state
        )

    def shapes(self, samples: int) -> list[tuple[int, int]]:
        """Samples and outputs of each group in what `scaled` returns."""
        return self.noise.lengths(samples)

    def differences(self, truth: Record, start: float, theta: Array, experiment: Experiment) -> list[Difference]:
        """How far this rival's outputs are from those of the truth in a free run of the experiment."""
        rival = experiment.run(self.model, engine=self.engine, theta=theta)
        left = np.sqrt(np.mean((rival.output - truth.output) ** 2, axis=0))
        return [
            Difference(output.name, float(value), output.unit, float(noise))
            for output, value, noise in zip(self.model.outputs, left, self.noise.sensors, strict=True)
        ]

    def of(self, samples: int, decades: float = 0.0) -> TimeVaryingObserver:
        """Observer for an experiment.

        Parameters
        ----------
        samples : int
        decades : float
            By which the disturbance is taken for stronger than it is.
        """
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
        """Innovations white and of unit variance where the rival is right.

        Parameters
        ----------
        raw : ndarray (n, p, k)
            Series of innovations.
        decades : float
            Of the observer that they are from.
        """
        noise = self.noise
        parts = []
        for group, step, whitener, weight, scaling in zip(
            noise.groups, noise.every, noise.whiteners, noise.weights, self._starts(len(raw), decades), strict=True
        ):
            own = np.ascontiguousarray(raw[:, group])
            own[: len(scaling)] = scaling @ own[: len(scaling)]
            white = [weight @ whitener.apply(np.ascontiguousarray(own[::step, :, i])).T for i in range(own.shape[2])]
            parts.append(np.stack(white, axis=2).transpose(1, 0, 2).reshape(-1, own.shape[2]))
        return np.concatenate(parts)

    def _starts(self, samples: int, decades: float) -> list[Array]:
        """What brings the first innovations, of a start that is uncertain, to the settled covariance, by group."""
        key = (samples, decades)
        if key not in self._scalings:
            covariance = self.of(samples, decades).covariance[:samples]
            roots = [np.linalg.cholesky(covariance[:, group][:, :, group]) for group in self.noise.groups]
            self._scalings[key] = [np.asarray(root[-1] @ np.linalg.inv(root)) for root in roots]
        return self._scalings[key]

    def transferred(self, raw: Array, decades: float) -> Array:
        """The same innovations as an observer for a stronger disturbance would have them, shape (n, p, k)."""
        given, wanted = self.of(len(raw)).gain, self.of(len(raw), decades).gain
        return transfer(raw, self._transition, self._output, given, wanted)

    def noise_at(self, decades: float) -> list[Array]:
        """Covariance, by group, that noise and disturbance as they are give the innovations of such an observer.

        In units of that of the right observer.
        """
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
        gain = self.of(max(samples for samples, _ in self._known), decades).gain
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
