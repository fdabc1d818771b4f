"""Innovations with the disturbance's intensity and memory as two more parameters of the search.

The same question as the prediction criterion asks, arranged for many refits of
neighbouring models: the disturbance may be anything from white to a random walk, and
the observer learns the initial state by itself, so that no initial state is searched
and every sample counts for every model.
"""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from idloop.errors import IdloopError
from idloop.estimate.criterion import Errors, InitialStates
from idloop.estimate.dataset import Data, output_groups
from idloop.estimate.settling import SettlingObserver, settling_observer

if TYPE_CHECKING:
    from idloop.physics import Engine
    from idloop.physics.engine import Linear

Array = NDArray[np.float64]

# Decades of the intensity about a walk that reaches the drive force within the record.
LEAST_EXPONENT, MOST_EXPONENT = -10.0, 10.0
# Decades of the time, in samples, over which the disturbance remembers: white, and for ever.
WHITE, WALK = -1.0, 5.0
# Fewest samples of a record that a glimpse takes.
_LEAST_GLIMPSE = 500
# First guesses of the initial motion may be wrong by this many times their typical size.
_START_SPREAD = 3.0


class InnovationCriterion:
    """Innovations of an observer that learns the start; nuisance are log10 of intensity and memory.

    Parameters
    ----------
    engine : Engine
        Compiled model.
    data : list of Data
        Records.
    output_noise : array, shape (p,)
        Standard deviation of each output's measurement noise.
    force_scale : float
        Typical drive force; the unit of the intensity.
    exponent : float
        Intensity to start from, in decades.
    memory : float
        Correlation time of the disturbance to start from, in decades of a sample.
    longest : float
        Longest correlation time that it may take.
    """

    name = "prediction"
    whiten = True

    def __init__(
        self,
        engine: Engine,
        data: list[Data],
        output_noise: Array,
        force_scale: float,
        exponent: float = -4.0,
        memory: float = WALK,
        longest: float = WALK,
    ) -> None:
        self.longest = longest
        self.engine, self.data, self.output_noise = engine, data, output_noise
        self.groups = output_groups(data)
        self.measured = sorted(column for group in self.groups for column in group)
        longest = max(float(d.time[-1] - d.time[0]) for d in data)
        self.unit, self._longest = force_scale**2 / longest, longest
        self.exponent, self.memory = exponent, min(memory, longest)
        self._shortest = min(d.sample_time for d in data)
        self.initial = InitialStates(engine, data, force_scale)
        self._linear: Linear = engine.linearise(None)
        self._chain: tuple[int, ...] = engine.layout(None).body_of
        self._observers: dict[tuple[float, float, float], tuple[SettlingObserver, list[Array]]] = {}
        self._rows = [[_usable(d, group) for d in data] for group in self.groups]

    @property
    def intensity(self) -> float:
        """Intensity of the disturbance force [force²/s]."""
        return float(self.unit * 10.0**self.exponent)

    def retune(self, theta: Array) -> None:
        """Design the observers anew for the linear part at these parameters."""
        self._linear = self.engine.linearise(theta)
        self._chain = self.engine.layout(theta).body_of
        self._observers.clear()

    def adopt(self, other: InnovationCriterion) -> None:
        """Use the observers of a neighbouring model with the same linear part."""
        self._linear, self._chain, self._observers = other._linear, other._chain, other._observers

    def glimpse(self, samples: int) -> InnovationCriterion | None:
        """The same on a stretch from the middle of every record; None where it would not be much shorter.

        Parameters
        ----------
        samples : int
            About so many of all records together.
        """
        total = sum(len(d.time) for d in self.data)
        if total < 2 * samples:
            return None
        stretches = [_middle(d, samples / total) for d in self.data]
        if not all(np.any(np.isfinite(d.output)) for d in stretches) or output_groups(stretches) != self.groups:
            return None
        short = copy(self)
        short.look_at(stretches)
        return short

    def look_at(self, data: list[Data]) -> None:
        """Read other records of the same outputs; the unit of the intensity stays."""
        self.data = data
        self.initial = InitialStates(self.engine, data, float(np.sqrt(self.unit * self._longest)))
        self._observers = {}
        self._rows = [[_usable(d, group) for d in data] for group in self.groups]

    def nuisance(self) -> tuple[Array, Array, Array, Array]:
        """Exponent and memory, their range and size."""
        here, low = np.array([self.exponent, self.memory]), np.array([LEAST_EXPONENT, WHITE])
        return here, low, np.array([MOST_EXPONENT, self.longest]), np.ones(2)

    def keep(self, nuisance: Array) -> None:
        """Go on from this disturbance."""
        self.exponent, self.memory = float(nuisance[0]), min(float(nuisance[1]), self.longest)

    def decay(self, memory: float, record: int) -> float:
        """Part of the disturbance that one sample of a record leaves for the next."""
        if memory >= WALK:
            return 1.0
        return float(np.exp(-self.data[record].sample_time / (self._shortest * 10.0**memory)))

    def innovation(self, theta: Array, nuisance: Array, record: int) -> Array:
        """One-step prediction errors of one record, shape (n, p), NaN where not measured."""
        d = self.data[record]
        observer, _ = self._observer(nuisance, record)
        state = self.initial.state(self.initial.values, record, theta)
        decay = self.decay(float(nuisance[1]), record)
        return self.engine.predict(theta, d.input_time, d.input, d.time, d.output, observer.gain, state, decay)

    def errors(self, theta: Array, nuisance: Array) -> Errors:
        """Innovations by group and record, those of the start scaled to the settled ones' covariance."""
        found: Errors = [[] for _ in self.groups]
        for r in range(len(self.data)):
            full = self.innovation(theta, nuisance, r)
            _, scalings = self._observer(nuisance, r)
            for place, (group, rows) in enumerate(zip(self.groups, self._rows, strict=True)):
                part = np.ascontiguousarray(full[:, group])
                # A short record may end before the observer has settled.
                scaling = scalings[place][: len(part)]
                part[: len(scaling)] = np.einsum("tij,tj->ti", scaling, part[: len(scaling)])
                found[place].append(np.ascontiguousarray(part[rows[r]]))
        return found

    def _observer(self, nuisance: Array, record: int) -> tuple[SettlingObserver, list[Array]]:
        """Observer of one record and the scaling of its first innovations, by group."""
        step = self.data[record].sample_time
        exponent, memory = float(nuisance[0]), float(nuisance[1])
        key = (exponent, memory, step)
        if key not in self._observers:
            if len(self._observers) > 16:
                self._observers.clear()
            samples = max(len(d.time) for d in self.data if d.sample_time == step)
            n = self.initial.bodies
            scale = _START_SPREAD * self.initial.part(self.initial.scale, record)
            # No more of a constant force than the disturbance makes by itself: an offset is not noise.
            gained, decay = self.unit * 10.0**exponent, self.decay(memory, record)
            scale[-1] = np.sqrt(gained * min(self._longest, step / max(1.0 - decay**2, 1e-12)))
            starts = [*self._chain, len(self._linear.A) // 2]
            halves = np.diff(starts)
            spread = np.concatenate([np.repeat(scale[:n], halves), np.repeat(scale[n : 2 * n], halves), scale[2 * n :]])
            observer = settling_observer(
                self._linear, self.measured, step, gained, self.output_noise, spread, samples, decay
            )
            if not np.all(np.isfinite(observer.gain)):
                raise IdloopError("no observer could be designed for this model and data")
            self._observers[key] = (observer, [_scalings(observer.covariance, group) for group in self.groups])
        return self._observers[key]


def _scalings(covariance: Array, group: list[int]) -> Array:
    """Matrices that bring the first innovations of a group to the settled covariance, shape (m, g, g)."""
    own = covariance[:, group][:, :, group]
    roots = np.linalg.cholesky(own)
    return np.asarray(roots[-1] @ np.linalg.inv(roots[:-1]))


def _middle(data: Data, share: float) -> Data:
    """A share of a record, from its middle."""
    count = max(round(share * len(data.time)), min(len(data.time), _LEAST_GLIMPSE))
    first = (len(data.time) - count) // 2
    part = slice(first, first + count)
    gaps = data.gaps[(data.gaps > first) & (data.gaps < first + count)] - first
    return replace(data, time=data.time[part], output=data.output[part], gaps=gaps)


def _usable(data: Data, group: list[int]) -> NDArray[np.bool_]:
    """Rows at which a group is measured, without the first one after a gap."""
    keep = np.all(np.isfinite(data.output[:, group]), axis=1)
    keep[data.gaps] = False
    return np.asarray(keep)
