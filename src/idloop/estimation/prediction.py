"""Prediction criterion: innovations of an observer that carries a disturbance force.

A free run drifts away on a plant that integrates its disturbances; the one-step
predictor does not. The observer's gain comes from the linear part, the prediction
step from the full nonlinear model; the intensity of the disturbance is read off
the data by the likelihood concentrated over the innovation covariance (Ljung,
System Identification, 2nd ed., ch. 7 and 15).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from idloop.errors import IdloopError
from idloop.estimation.criterion import Errors, InitialStates
from idloop.estimation.dataset import Data, output_groups
from idloop.estimation.observer.observer import Observer, design
from idloop.estimation.optimisation.problem import Problem

if TYPE_CHECKING:
    from idloop.physics import Engine
    from idloop.physics.engine import Linear

Array = NDArray[np.float64]

# Share of a record that may be spent on letting the observer forget its start.
_BURN_IN_SHARE = 0.05
# Range of the search, in decades about a walk that reaches the drive force within the record.
_LEAST_EXPONENT, _MOST_EXPONENT = -14.0, 10.0
_NO_OBSERVER = "no observer could be designed for this model and data; try the simulation criterion"


class PredictionCriterion:
    """Innovations of the stationary observer on every record.

    Parameters
    ----------
    engine : Engine
        Compiled model.
    data : list of Data
        Records.
    output_noise : array, shape (p,)
        Standard deviation of each output's measurement noise.
    force_scale : float
        Typical drive force; sets the range in which the disturbance is searched.
    near : float, optional
        Disturbance intensity [force²/s] that a part of the data has told: only half a decade beside it is looked at.
    """

    name = "prediction"
    whiten = True

    def __init__(
        self, engine: Engine, data: list[Data], output_noise: Array, force_scale: float, near: float | None = None
    ) -> None:
        self.engine, self.data, self.output_noise = engine, data, output_noise
        self.groups = output_groups(data)
        self.measured = sorted(column for group in self.groups for column in group)
        self.sample_time = float(np.median([d.sample_time for d in data]))
        self.force_scale = force_scale
        self.initial = InitialStates(engine, data, force_scale)
        self.intensity = 0.0
        self.near = near
        self._rounds = 0
        self.observer = Observer(np.zeros((0, 0)), np.inf, np.zeros((0, 0)))
        self.estimate_start = True
        self._rows: list[list[NDArray[np.bool_]]] = []
        self._memory: dict[tuple[int, bytes], Array] = {}

    # -- the observer ---------------------------------------------------------------

    def _design(self, linear: Linear, intensity: float) -> Observer:
        a, c, g = linear.A, linear.C, linear.G
        used = self.measured
        observer = design(a, c[used], g, self.sample_time, intensity, self.output_noise[used])
        gain = np.zeros((len(a) + 1, len(c)))
        gain[:, used] = observer.gain
        return Observer(gain, observer.memory, observer.covariance)

    def retune(self, theta: Array) -> None:
        """Search the disturbance intensity and design the observer for it.

        The first search compares raw innovations. Later ones compare what is left
        after whitening, penalised for its order: coloured measurement noise would
        otherwise pass for a violent disturbance that no autoregression of sensible
        length can undo.
        """
        linear = self.engine.linearise(theta)
        longest = max(float(d.time[-1] - d.time[0]) for d in self.data)
        # A walk that reaches the whole drive force within the record, and decades around it.
        unit = self.force_scale**2 / longest
        self._rounds += 1
        starts: dict[float, Array] = {}

        def cost(exponent: float) -> float:
            try:
                self._use(self._design(linear, unit * 10.0**exponent))
                value, start = self._profile(theta, whiten=self._rounds > 1)
            except (IdloopError, np.linalg.LinAlgError):
                return np.inf
            # An observer that a delay of a sensor makes unstable predicts nothing.
            if not np.isfinite(value):
                return np.inf
            starts[exponent] = start
            return value

        if self.near is not None:
            best = min(np.log10(self.near / unit) + np.array([0.0, -0.5, 0.5]), key=cost)
            if best not in starts:
                raise IdloopError(_NO_OBSERVER)
        elif self._rounds <= 3:
            best = _search(cost, np.arange(-12.0, 6.1, 2.0))
        else:
            centre = float(np.log10(self.intensity / unit))
            best = _search(cost, centre + np.array([-1.0, -0.5, 0.0, 0.5, 1.0]))
        self.intensity = unit * 10.0**best
        self._use(self._design(linear, self.intensity))
        self.keep(starts[best])

    def fix(self, theta: Array, intensity: float) -> None:
        """Use a known disturbance intensity [force²/s]; initial states at their best for it."""
        self.intensity = intensity
        self._use(self._design(self.engine.linearise(theta), intensity))
        self.keep(self._profile(theta, whiten=False)[1])

    def _profile(self, theta: Array, whiten: bool) -> tuple[float, Array]:
        """Mean log-likelihood cost with the initial states at their best, and those states."""
        problem = Problem(self, len(theta))
        start, _, _, scale = self.nuisance()
        point = np.concatenate([theta, start])
        problem.reweigh(point, whiten)
        if len(start):
            # Innovations are all but linear in the initial states: one Gauss-Newton step does.
            base = problem.frozen_residual(point)
            slope = np.empty((len(base), len(start)))
            for i, size in enumerate(scale):
                moved = point.copy()
                moved[len(theta) + i] += 1e-4 * size
                slope[:, i] = (problem.frozen_residual(moved) - base) / 1e-4
            if np.all(np.isfinite(slope)):
                gradient = slope.T @ base
                hessian = slope.T @ slope + 1e-12 * np.trace(slope.T @ slope) * np.eye(len(start))
                trial = np.concatenate([theta, start - scale * np.linalg.lstsq(hessian, gradient, rcond=None)[0]])
                rival = Problem(self, len(theta))
                rival.reweigh(trial, whiten)
                if rival.objective < problem.objective:
                    problem, point = rival, trial
        samples = problem.count(point)
        penalty = sum(2.0 * m * len(g) ** 2 for m, g in zip(problem.orders, self.groups, strict=True))
        # Observers of different memory drop different numbers of samples: compare the mean.
        return (problem.objective + penalty) / max(samples, 1), point[len(theta) :]

    def _use(self, observer: Observer) -> None:
        self.observer = observer
        self._memory.clear()
        shortest = min(len(d.time) for d in self.data)
        self.estimate_start = observer.memory > _BURN_IN_SHARE * shortest
        drop = 0 if self.estimate_start else int(np.ceil(observer.memory))
        self._rows = [[_settled(d, group, drop) for d in self.data] for group in self.groups]

    # -- the criterion --------------------------------------------------------------

    def nuisance(self) -> tuple[Array, Array, Array, Array]:
        """Initial states when the observer is slow to forget them, nothing otherwise."""
        if not self.estimate_start:
            empty = np.zeros(0)
            return empty, empty, empty, empty
        values = self.initial.values
        unbounded = np.full(len(values), np.inf)
        return values, -unbounded, unbounded, self.initial.scale

    def keep(self, nuisance: Array) -> None:
        """Start the next search from these initial states."""
        if len(nuisance):
            self.initial.values = nuisance.copy()

    def innovation(self, theta: Array, nuisance: Array, record: int) -> Array:
        """One-step prediction errors of one record, shape (n, p), NaN where not measured."""
        values = nuisance if len(nuisance) else self.initial.values
        key = (record, theta.tobytes() + self.initial.part(values, record).tobytes())
        if key not in self._memory:
            if len(self._memory) > 4 * len(self.data):
                self._memory.clear()
            d = self.data[record]
            state = self.initial.state(values, record, theta)
            self._memory[key] = self.engine.predict(
                theta,
                d.input_time,
                d.input,
                d.time,
                d.output,
                self.observer.gain,
                initial_state=state,
                conditions=d.conditions,
            )
        return self._memory[key]

    def errors(self, theta: Array, nuisance: Array) -> Errors:
        """Innovations by group and record, after the observer has forgotten its start."""
        full = [self.innovation(theta, nuisance, r) for r in range(len(self.data))]
        return [
            [np.ascontiguousarray(e[keep][:, group]) for e, keep in zip(full, rows, strict=True)]
            for group, rows in zip(self.groups, self._rows, strict=True)
        ]


def _settled(data: Data, group: list[int], drop: int) -> NDArray[np.bool_]:
    """Rows of a record at which a group is measured and the observer is stationary."""
    keep = np.all(np.isfinite(data.output[:, group]), axis=1)
    for start in (0, *data.gaps):
        keep[start : start + max(drop, 1 if start else 0)] = False
    return np.asarray(keep)


def _search(function: Callable[[float], float], grid: Array) -> float:
    """Minimum of a one-dimensional function: the best of a grid, refined by halving."""
    values = [function(float(x)) for x in grid]
    points = [float(x) for x in grid]
    spacing = float(np.min(np.diff(grid)))
    # Walk on where the best lies on the edge, a dozen steps at most.
    for _ in range(12):
        best = int(np.argmin(values))
        if not np.isfinite(values[best]) or 0 < best < len(points) - 1:
            break
        beyond = points[best] + (spacing if best else -spacing)
        if not _LEAST_EXPONENT <= beyond <= _MOST_EXPONENT:
            break
        place = len(points) if best else 0
        points.insert(place, beyond)
        values.insert(place, function(beyond))
    best = int(np.argmin(values))
    if not np.isfinite(values[best]):
        raise IdloopError(_NO_OBSERVER)
    centre, step, value = points[best], spacing / 2.0, values[best]
    while step > 0.2:
        for trial in (centre - step, centre + step):
            found = function(trial)
            if found < value:
                centre, value = trial, found
                break
        step /= 2.0
    return centre
