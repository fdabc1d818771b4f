"""Could anybody have told? What an observer that knows the noise can say about a hidden effect.

The diagnosis has no part in this. The true model's one-step prediction errors, at the true values,
give the noise model: a stationary observer for the best of a few disturbance intensities and a
vector autoregression that whitens what the observer leaves coloured. With this noise model held,
the model without the effect is fitted by least squares, from the true values of everything else.
The log-likelihood that it loses, in units of one, is the effect's *gain*.

A test at a family-wise rate of 1 % over sixty candidates needs a deviate of 3.76 for one parameter,
and finds in 99.9 % what lies 3.09 further out: twice the gain is 6.85 squared. So an effect is
**testable** when its gain is at least 24, **untestable** below 3 and **weak** between.

Two effects are **separable** when the best model with the one in place of the other loses as much.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

TESTABLE = 24.0
HOPELESS = 3.0
# Order of the whitening autoregression.
ORDER = 12
# Exponents of the disturbance intensity that are tried, in decades of (drive force)^2 per record.
EXPONENTS = np.arange(-9.0, 5.1, 1.0)
# Steps of a fit: a few; more when what is left lies within reach of the threshold.
FIRST_STEPS, MORE_STEPS, REACH = 4, 12, 100.0


@dataclass(frozen=True)
class Noise:
    """What the oracle knows: observer gain and whitening filter.

    Attributes
    ----------
    gain : ndarray (2 b + 1, p)
    filter : ndarray (order p, p)
        Coefficients on the past prediction errors.
    shape : ndarray (p, p)
        Turns prediction errors of unit whiteness into unit variance.
    drop : int
        Samples at the start that do not count.
    """

    gain: Array
    filter: Array
    shape: Array
    drop: int


class Oracle:
    """The best that can be said about one case.

    Parameters
    ----------
    truth : Model
        The machine as it is, without rounding; what is to be fitted is free.
    records : sequence of Record
        Training recordings.
    sensors : Model, optional
        The machine with its rounding: how noisy the sensors really are.
    walking : bool
        The disturbance is a random walk, which the observer then carries as a state. Otherwise it is
        stationary and counts as noise of the velocities: an observer with such a state would take every
        constant force for a disturbance.

    Attributes
    ----------
    best : Model
        The true structure, fitted.
    loss : float
        Its negative log-likelihood, up to a constant.
    """

    def __init__(self, truth: Any, records: Sequence[Any], sensors: Any | None = None, *, walking: bool = True) -> None:
        self.truth, self.records, self.walking = truth, records, walking
        self._std = _effective_noise(truth if sensors is None else sensors)
        self.noise = self._noise()
        # at the true values, or the best near them: a predictor is no perfect observer of dry friction
        self.loss = self._loss(truth, None)
        theta, loss = self.fitted(truth)
        self.best = truth if loss > self.loss else truth.with_theta(theta)
        self.loss = min(self.loss, loss)

    # -- prediction errors ------------------------------------------------------------

    def _errors(self, model: Any, theta: Array | None, gain: Array) -> list[Array]:
        from idloop.physics import Engine

        engine = Engine(model)
        wanted = engine.layout(theta).bodies
        own = (len(gain) - 1) // 2
        if wanted != own:
            gain = _resized(gain, own, engine.layout(theta).body_of, wanted)
        found = []
        for r in self.records:
            start = engine.initial_state(theta=theta)
            found.append(engine.predict(theta, r.input_time, r.input, r.time, r.output, gain, start))
        return found

    @np.errstate(all="ignore")
    def _noise(self) -> Noise:
        from idloop.errors import IdloopError
        from idloop.physics import Engine

        engine = Engine(self.truth)
        linear = engine.linearise(None)
        period = self.records[0].sample_time
        force = self.truth.values["drive.gain"] * float(np.std(np.concatenate([r.input for r in self.records])))
        unit = force**2 / self.records[0].duration
        best: tuple[float, Array, list[Array], int] | None = None
        for exponent in EXPONENTS:
            try:
                tuned, memory = self._observer(linear, period, unit * 10.0**exponent)
            except (IdloopError, np.linalg.LinAlgError):
                continue
            drop = int(min(memory, 0.2 * len(self.records[0].time)))
            errors = self._errors(self.truth, None, tuned)
            if not all(np.all(np.isfinite(e)) for e in errors):
                continue
            stacked = np.concatenate([e[drop:] for e in errors])
            cost = float(np.linalg.slogdet(stacked.T @ stacked / len(stacked))[1])
            if best is None or cost < best[0]:
                best = cost, tuned, errors, drop
        if best is None:
            raise ValueError("no observer suits the true model")
        _, gain, errors, drop = best
        past, now = _lagged([e[drop:] for e in errors])
        coefficients = np.linalg.lstsq(past, now, rcond=None)[0]
        left = now - past @ coefficients
        covariance = left.T @ left / len(left)
        return Noise(gain, coefficients, np.linalg.inv(np.linalg.cholesky(covariance)).T, drop)

    def _observer(self, linear: Any, period: float, intensity: float) -> tuple[Array, float]:
        """Gain and memory of the stationary observer for a disturbance intensity."""
        from idloop.estimation.observer.stationary import design, discretise, riccati

        if self.walking:
            observer = design(linear.A, linear.C, linear.G, period, intensity, self._std)
            return observer.gain, observer.memory
        # the same intensity per record, all of it in one sample's white force
        push = np.outer(linear.G, linear.G) * intensity * period * self.records[0].duration
        transition, process = discretise(linear.A, push, period)
        output = linear.C / self._std[:, None]
        prediction = riccati(transition * (1.0 - 1e-7), output, process, np.eye(len(output)))
        innovation = output @ prediction @ output.T + np.eye(len(output))
        gain = np.linalg.solve(innovation, output @ prediction).T / self._std[None, :]
        closed = transition @ (np.eye(len(transition)) - gain @ linear.C)
        slowest = float(np.max(np.abs(np.linalg.eigvals(closed))))
        memory = np.inf if slowest >= 1.0 else np.log(1e-3) / np.log(slowest)
        return np.vstack([gain, np.zeros(len(output))]), float(memory)

    def whitened(self, model: Any, theta: Array | None) -> Array:
        """Whitened prediction errors of a model, flat; of unit variance for the truth."""
        errors = self._errors(model, theta, self.noise.gain)
        past, now = _lagged([e[self.noise.drop :] for e in errors])
        white = (now - past @ self.noise.filter) @ self.noise.shape
        return np.nan_to_num(white.ravel(), nan=1e6, posinf=1e6, neginf=-1e6)

    def _loss(self, model: Any, theta: Array | None) -> float:
        return 0.5 * float(np.sum(self.whitened(model, theta) ** 2))

    # -- the two questions --------------------------------------------------------------

    def fitted(self, model: Any) -> tuple[Array, float]:
        """Free parameters of a model at their best, searched from where they stand, and the loss there."""
        from scipy.optimize import least_squares

        start = model.theta
        if len(start) == 0:
            return start, self._loss(model, None)
        lower, upper = model.bounds
        scale = np.where(start != 0.0, np.abs(start), 1e-3)
        theta = np.clip(start, lower + 1e-9 * scale, upper - 1e-9 * scale)
        cost = np.inf
        for steps in (FIRST_STEPS, MORE_STEPS):
            with np.errstate(all="ignore"):
                found = least_squares(
                    lambda value: self.whitened(model, value),
                    theta,
                    bounds=(lower, upper),
                    x_scale=scale,
                    diff_step=1e-5,
                    ftol=1e-6,
                    xtol=1e-7,
                    gtol=1e-10,
                    max_nfev=steps,
                )
            theta, cost = found.x, float(found.cost)
            if found.status > 0 or cost > self.loss + REACH * TESTABLE:
                break
        return theta, cost

    def gain(self, effects: Sequence[str]) -> float:
        """Log-likelihood that the best model without these effects loses."""
        return self.fitted(self.truth.without_effects(effects))[1] - self.loss

    def gap(self, effect: str, rivals: Sequence[Any]) -> float:
        """Log-likelihood that the best of some models with another effect in its place loses."""
        return min((self.fitted(model)[1] for model in rivals), default=np.inf) - self.loss


def _effective_noise(model: Any) -> Array:
    """Noise of each output with its rounding."""
    values = model.values
    std = []
    for output in model.outputs:
        step = values.get(f"sensor_quantisation@{output.site}.resolution", 0.0)
        std.append(float(np.hypot(output.noise, step / np.sqrt(12.0))))
    return np.array(std)


def _lagged(errors: list[Array]) -> tuple[Array, Array]:
    """Past errors beside the present ones, records apart."""
    past, now = [], []
    for e in errors:
        count = len(e) - ORDER
        past.append(np.concatenate([e[ORDER - 1 - i : ORDER - 1 - i + count] for i in range(ORDER)], axis=1))
        now.append(e[ORDER:])
    return np.concatenate(past), np.concatenate(now)


def _resized(gain: Array, own: int, body_of: Sequence[int], wanted: int) -> Array:
    """Observer gain for a chain of another number of bodies: halves of one body move together."""
    if own < wanted:
        first = [*body_of, wanted]
        repeat = np.concatenate([np.full(first[i + 1] - first[i], i) for i in range(own)])
        return np.concatenate([gain[:own][repeat], gain[own : 2 * own][repeat], gain[2 * own :]])
    # the truth has more bodies: one half of each speaks for both
    keep = np.arange(own)[:wanted]
    return np.concatenate([gain[:own][keep], gain[own : 2 * own][keep], gain[2 * own :]])
