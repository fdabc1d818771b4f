"""Criterion of one-step prediction errors (innovations) of an observer with a disturbance force.

A free run diverges on a plant that integrates its disturbances; the one-step prediction does not. The simulation is
nonlinear, the observer gains come from the linear part of the model. Intensity and memory of the disturbance are
nuisance parameters: it may be anything from white noise to a random walk. The observer estimates the initial state
itself, so that all samples of all models enter the likelihood (Ljung, System Identification, 2nd ed., ch. 7 and 15).
"""

from __future__ import annotations

from copy import copy
from typing import TYPE_CHECKING

import numpy as np

from idloop.arrays import Array, Mask
from idloop.errors import IdloopError
from idloop.estimation.criterion import Errors, InitialStates
from idloop.estimation.dataset import Data, output_groups
from idloop.estimation.observer.time_varying import (
    TimeVaryingObserver,
    scale_start,
    scalings_to_last,
    time_varying_observer,
)

if TYPE_CHECKING:
    from idloop.physics import Engine
    from idloop.physics.engine import Linear


# Range of the intensity, in decades about a random walk that reaches the drive force within the record.
LEAST_EXPONENT, MOST_EXPONENT = -10.0, 10.0
# Memory of white noise and of a random walk [decades of a sample].
WHITE, WALK = -1.0, 5.0
# Fewest samples of a record in a subset.
_LEAST_GLIMPSE = 500
# Standard deviation of the first guess of the initial motion, as a multiple of its typical size.
_START_DEVIATION = 3.0


class InnovationCriterion:
    """Innovations of a Kalman filter from an uncertain start; nuisance are log10 of intensity and memory.

    `output_noise` (p,): standard deviation of each output's measurement noise.
    `force_scale`: typical drive force; the unit of the intensity.
    `exponent`, `memory`: initial intensity [decades] and correlation time of the disturbance [decades of a sample].
    `groups`: outputs that share a noise model; those measured at the same instants when left out.
    """

    name = "prediction"
    whiten = True
    _observers: dict[tuple[float, float, float], tuple[TimeVaryingObserver, list[Array]]]
    _last: dict[int, tuple[bytes, Array]]

    def __init__(
        self,
        engine: Engine,
        data: list[Data],
        output_noise: Array,
        force_scale: float,
        exponent: float = -4.0,
        memory: float = WALK,
        groups: list[list[int]] | None = None,
    ) -> None:
        self.longest, self.strongest = WALK, MOST_EXPONENT  # limits of correlation time and intensity [decades]
        # Whether innovations are translated from one disturbance to another; False after a translation has failed
        self.translates = True
        self.engine, self.output_noise = engine, output_noise
        self.groups = groups or output_groups(data)
        self.measured = sorted(column for group in self.groups for column in group)
        self._longest = max(float(d.time[-1] - d.time[0]) for d in data)
        self.unit = force_scale**2 / self._longest
        self.exponent, self.memory = exponent, memory
        self._shortest = min(d.sample_time for d in data)
        self.linear: Linear = engine.linearise(None)
        self._chain: tuple[int, ...] = engine.layout(None).body_of
        self.use_data(data)

    @property
    def intensity(self) -> float:
        """Intensity of the disturbance force [force²/s]."""
        return float(self.unit * 10.0**self.exponent)

    def retune(self, theta: Array) -> None:
        """Take the linear part at these parameters for the observers."""
        self.linear = self.engine.linearise(theta)
        self._chain = self.engine.layout(theta).body_of
        self._observers.clear()
        self._last.clear()

    def adopt(self, other: InnovationCriterion) -> None:
        """Use the observers of a model with the same linear part."""
        self.linear, self._chain, self._observers = other.linear, other._chain, other._observers
        self._last.clear()

    def subset(self, samples: int) -> InnovationCriterion | None:
        """The criterion on about so many samples from the middles of all records; None for records not much longer."""
        total = sum(len(d.time) for d in self.data)
        if total < 2 * samples:
            return None
        stretches = [_middle(d, samples / total) for d in self.data]
        known = [np.isfinite(d.output) for d in stretches]
        whole = all(any(np.any(np.all(one[:, group], axis=1)) for one in known) for group in self.groups)
        if not whole or not all(map(np.any, known)):
            return None
        short = copy(self)
        short.use_data(stretches)
        return short

    def use_data(self, data: list[Data]) -> None:
        """Use other records of the same outputs, with the same unit of the intensity."""
        self.data = data
        self.initial = InitialStates(self.engine, data, float(np.sqrt(self.unit * self._longest)))
        self._observers, self._last = {}, {}
        self._rows = [[_usable(d, group) for d in data] for group in self.groups]

    def nuisance(self) -> tuple[Array, Array, Array, Array]:
        """Exponent and memory, their range and size."""
        here, low = np.array([self.exponent, self.memory]), np.array([LEAST_EXPONENT, WHITE])
        return here, low, np.array([self.strongest, self.longest]), np.ones(2)

    def keep(self, nuisance: Array) -> None:
        """Set the disturbance."""
        self.exponent = min(float(nuisance[0]), self.strongest)
        self.memory = min(float(nuisance[1]), self.longest)

    def decay(self, memory: float, record: int) -> float:
        """Factor of the disturbance from one sample of a record to the next."""
        if memory >= WALK:
            return 1.0
        return float(np.exp(-self.data[record].sample_time / (self._shortest * 10.0**memory)))

    def innovation(self, theta: Array, nuisance: Array, record: int) -> Array:
        """One-step prediction errors of one record, shape (n, p), NaN where not measured."""
        key = theta.tobytes() + nuisance.tobytes()
        if record not in self._last or self._last[record][0] != key:
            d, observer = self.data[record], self.observer(nuisance, record)
            gain = observer.gains.reshape(-1, d.output.shape[1])
            state = self.initial.state(self.initial.values, record, theta)
            decay = self.decay(float(nuisance[1]), record)
            found = self.engine.predict(
                theta, d.input_time, d.input, d.time, d.output, gain, state, decay, observer.place, d.conditions
            )
            self._last[record] = key, found
        return self._last[record][1]

    def errors(self, theta: Array, nuisance: Array) -> Errors:
        """As of `arranged`, at given parameters."""
        return self.arranged([self.innovation(theta, nuisance, r) for r in range(len(self.data))], nuisance)

    def arranged(self, innovations: list[Array], nuisance: Array) -> Errors:
        """Innovations (n, p) of the records by group and record; the first ones are scaled to the final covariance."""
        found: Errors = [[] for _ in self.groups]
        for r, full in enumerate(innovations):
            observer, scalings = self._observer(nuisance, r)
            for place, (group, rows) in enumerate(zip(self.groups, self._rows, strict=True)):
                part = full.copy() if len(group) == full.shape[1] else np.ascontiguousarray(full[:, group])
                scale_start(part, scalings[place], observer.place)
                found[place].append(part if rows[r] is None else part[rows[r]])
        return found

    def start_scaling(self, nuisance: Array, record: int, place: int, instant: int) -> float:
        """Log determinant of the scaling of an innovation in `arranged`, of one record, group and sample."""
        observer, scalings = self._observer(nuisance, record)
        first = observer.place[min(instant, len(observer.place) - 1)]
        return float(np.linalg.slogdet(scalings[place][first])[1])

    def observer(self, nuisance: Array, record: int) -> TimeVaryingObserver:
        """Observer of one record."""
        return self._observer(nuisance, record)[0]

    def _observer(self, nuisance: Array, record: int) -> tuple[TimeVaryingObserver, list[Array]]:
        """Observer of one record and the scaling of its first innovations, by group."""
        step = self.data[record].sample_time
        exponent, memory = float(nuisance[0]), float(nuisance[1])
        key = (exponent, memory, step)
        if key not in self._observers:
            if len(self._observers) > 16:
                self._observers.clear()
            samples = max(len(d.time) for d in self.data if d.sample_time == step)
            n = self.initial.bodies
            scale = _START_DEVIATION * self.initial.part(self.initial.scale, record)
            # The disturbance's own variance: a constant force is no part of the noise.
            variance_rate, decay = self.unit * 10.0**exponent, self.decay(memory, record)
            scale[-1] = np.sqrt(variance_rate * min(self._longest, step / max(1.0 - decay**2, 1e-12)))
            starts = [*self._chain, len(self.linear.A) // 2]
            halves = np.diff(starts)
            deviation = np.concatenate(
                [np.repeat(scale[:n], halves), np.repeat(scale[n : 2 * n], halves), scale[2 * n :]]
            )
            observer = time_varying_observer(
                self.linear, self.measured, step, variance_rate, self.output_noise, deviation, samples, decay
            )
            if not np.all(np.isfinite(observer.gains)):
                raise IdloopError("no observer could be designed for this model and data")
            self._observers[key] = (observer, [_scalings(observer.covariances, group) for group in self.groups])
        return self._observers[key]


def _scalings(covariance: Array, group: list[int]) -> Array:
    """Scaling of a group's innovations to the final covariance, one matrix for each gain, shape (m, g, g)."""
    own = np.ascontiguousarray(covariance[:, group][:, :, group])
    return np.asarray(scalings_to_last(own))


def _middle(data: Data, share: float) -> Data:
    """Middle part of a record."""
    count = max(round(share * len(data.time)), min(len(data.time), _LEAST_GLIMPSE))
    first = (len(data.time) - count) // 2
    return data.part(first, first + count, all_commands=True)


def _usable(data: Data, group: list[int]) -> Mask | None:
    """Rows with a measurement of a group, without the first one after a gap; None for all rows."""
    keep = np.all(np.isfinite(data.output[:, group]), axis=1)
    keep[data.gaps] = False
    return None if np.all(keep) else np.asarray(keep)
