"""Recursive estimator of a nonlinear model for live data.

Recursive prediction error method (Ljung and Söderström, Theory and Practice of Recursive Identification, 1983) on the
one-step predictor of a stationary observer. The derivatives of the prediction come from a bank of predictors, one for
each parameter with a small change of it, that run over blocks of the same data.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from idloop.arrays import Array
from idloop.errors import IdloopError, InputError
from idloop.estimation.observer.innovation_covariance import OUTLIER, InnovationCovariance
from idloop.estimation.observer.predictor_bank import PredictorBank
from idloop.estimation.observer.sensor_noise import noise_std
from idloop.estimation.observer.stationary import design

if TYPE_CHECKING:
    from idloop.physics import Model


# Rival observers assume this factor more and less disturbance.
_RIVAL = 3.0


class RecursiveEstimator:
    """Predict every sample, and update the parameters after every block.

    `model`: starting values, bounds and free parameters.
    `sample_time`: nominal sample time [s]; from the first two samples when left out.
    `forgetting_time`: time constant of exponential forgetting [s]; infinite for none.
    `block`: samples between two parameter updates.
    `prior`: standard deviation of the starting values relative to their size.
    `disturbance`: initial intensity of the disturbance force [force unit per √s]; from the model file when left out,
    else 5 % of the drive force per √s. It is adapted by comparison with predictors of higher and lower intensity.
    `adapt`: False keeps the parameters and only predicts, at the cost of one simulation step per sample.

    Attributes
    ----------
    innovation : array, shape (p,)
        Of the latest sample; NaN where not measured.
    resets, late : int
        Number of restarts from a measurement (gap, clock reset, divergence), and of samples that were dropped for an
        old stamp.
    """

    def __init__(
        self,
        model: Model,
        *,
        sample_time: float | None = None,
        forgetting_time: float = np.inf,
        block: int = 50,
        prior: float = 0.5,
        disturbance: float | None = None,
        adapt: bool = True,
    ) -> None:
        if block < 1 or not forgetting_time > 0.0 or not prior > 0.0:
            raise InputError("block, forgetting_time and prior must be positive")
        self.adapt = adapt
        self.block = block
        self.forgetting_time = forgetting_time
        self.prior = prior
        self.sample_time = sample_time
        self.resets = self.late = 0
        self._origin = np.nan
        self._last: float | None = None
        self._innovations = InnovationCovariance(len(model.outputs))
        self._memory = self._unsettled = 0.0
        # Noise of outputs for which the model file has none, until it is estimated.
        self._noise = np.full(len(model.outputs), 1e-3)
        self._first_noise = np.zeros(len(model.outputs))
        self._disturbance = disturbance if disturbance is not None else model.disturbance
        self._command_size = 1.0
        self._outputs = len(model.outputs)
        self._clear(model)

    @property
    def model(self) -> Model:
        """The model with the current parameters and standard errors."""
        stderr = self.stderr
        errors = {n: float(s) for n, s in zip(self._model.free, stderr, strict=True) if np.isfinite(s)}
        return self._model.with_values(self.parameters, errors if self._updates else None)

    @property
    def parameters(self) -> dict[str, float]:
        """Current value of every free parameter."""
        return dict(zip(self._model.free, (float(v) for v in self.theta), strict=True))

    @property
    def covariance(self) -> Array:
        """Covariance of the parameters, shape (k, k), for white innovations."""
        return np.asarray(np.linalg.inv(self._information) if len(self.theta) else np.zeros((0, 0)))

    @property
    def stderr(self) -> Array:
        """Standard errors, shape (k,)."""
        return np.asarray(np.sqrt(np.maximum(np.diag(self.covariance), 0.0)))

    def set_model(self, model: Model) -> None:
        """Continue with another model or other values.

        The state is kept when the bodies are the same; the information on the parameters is reset.

        `model`: with the same outputs. Raises InputError: if the outputs differ.
        """
        if len(model.outputs) != self._outputs:
            raise InputError(f"model {model.name!r} has {len(model.outputs)} outputs, not {self._outputs}")
        last, old = self._last, self._bank
        innovations = self._innovations
        self._clear(model)
        self._innovations = innovations
        if last is not None and np.isfinite(self.sample_time or np.nan):
            self._last = last
            self._design()
            self._bank.take_over(old)
            self._unsettled = 0

    def update(self, t: float, u: float, y: ArrayLike) -> Array:
        """Process one sample.

        `t`: time of the measurement [s]. `u`: command from ``t`` on, after the measurement. `y` (p,): measurement; not
        finite where there is none. Returns shape (p,): prediction of ``y`` from all earlier samples; NaN for the first
        sample, after a gap, or for an old stamp.
        """
        row = np.reshape(np.asarray(y, dtype=float), (1, -1))
        return np.asarray(self.update_block(np.array([t]), np.array([u]), row)[0])

    def update_block(self, t: ArrayLike, u: ArrayLike, y: ArrayLike) -> Array:
        """Process several samples.

        `t`, `u` (n,): times [s] and commands from there on. `y` (n, p): measurements; not finite where there is none.
        Returns shape (n, p): predictions, as of `update`.
        """
        times = np.array(t, dtype=float)
        commands = np.ascontiguousarray(u, dtype=float)
        measured = np.array(y, dtype=float, order="C")
        # An infinite reading counts as missing.
        measured[~np.isfinite(measured)] = np.nan
        prediction = np.full(measured.shape, np.nan)
        if not np.isfinite(self._origin) and len(times):
            self._origin = float(times[0])
        # Absolute stamps would lose nanoseconds to rounding.
        times -= self._origin
        start = 0
        while start < len(times):
            stop = self._segment_end(times, start)
            if stop == start:
                start += 1
                continue
            part = slice(start, stop)
            self._run(times[part], commands[part], measured[part], prediction[part])
            start = stop
        if len(times):
            self.innovation = measured[-1] - prediction[-1]
        return prediction

    def _segment_end(self, times: Array, start: int) -> int:
        """End of the next samples without a gap and within the block; handles gaps and old stamps."""
        first = times[start]
        if not np.isfinite(first):
            self.late += 1
            return start
        if self._last is not None:
            step = self.sample_time or np.inf
            if first <= self._last:
                # A slightly old stamp is a late sample, an older one a clock reset.
                if first > self._last - max(1.0, 100.0 * step):
                    self.late += 1
                    return start
                self._restart()
            elif np.isfinite(step) and first - self._last > max(20.0 * step, 0.05):
                self._restart()
        room = self.block - self._bank.waiting
        stop = min(start + max(room, 1), len(times))
        if self._last is None:
            return start + 1
        steps = np.diff(times[start:stop])
        limit = max(20.0 * (self.sample_time or np.inf), 0.05)
        broken = np.flatnonzero((steps <= 0.0) | (steps > limit) | ~np.isfinite(steps))
        return int(start + 1 + broken[0]) if len(broken) else stop

    def _run(self, t: Array, u: Array, y: Array, prediction: Array) -> None:
        if self._last is None:
            # The first sample gives the initial state.
            self._bank.start(t[0], u[0], y[0])
            self._last = float(t[0])
            self._unsettled = self._memory
            return
        if self.sample_time is None:
            self.sample_time = float(t[0] - self._last)
        if not self._designed:
            self._design()
            self._unsettled = self._memory
        innovation = self._bank.advance(t, u, y)
        self._last = float(t[-1])
        prediction[:] = y - innovation
        if self._diverged(innovation):
            self._restart()
            return
        if self._bank.waiting >= self.block:
            used = self._unsettled <= 0.0
            self._unsettled -= self._bank.waiting
            if used or not self._innovations.known:
                self._innovations.update(self._bank.innovations())
            self._update_parameters(used)

    def _restart(self) -> None:
        self.resets += 1
        self._last = None
        self._bank.drop()

    def _diverged(self, innovation: Array) -> bool:
        return not np.all(np.isfinite(self._bank.motion)) or self._innovations.diverged(innovation)

    def _clear(self, model: Model) -> None:
        self._model = model
        self.theta = model.theta.astype(float)
        self._lower, self._upper = model.bounds
        self._size = np.where(self.theta != 0.0, np.abs(self.theta), np.nan)
        self._bank = PredictorBank(model)
        self._information = np.diag(1.0 / (self.prior * np.where(np.isfinite(self._size), self._size, 1.0)) ** 2)
        self._innovations = InnovationCovariance(self._outputs)
        self._last = None
        self._designed = False
        self._designed_for = self.theta.copy()
        self._intensity = 0.0
        self._rival_cost = np.zeros(3)
        self._rival_age = 0
        self._memory = 0.0
        self._unsettled = 0.0
        self._updates = 0
        self.innovation = np.full(self._outputs, np.nan)

    def _design(self) -> None:
        """Observer gains for the current parameters: of the main predictor and of its two rivals."""
        step = self.sample_time or 0.0
        linear = self._bank.engine.linearise(self.theta)
        noise = np.array([o.noise or np.nan for o in self._model.outputs], dtype=float)
        noise = np.where(np.isfinite(noise), noise, self._noise)
        intensity = self._disturbance
        if intensity is None:
            force = np.linalg.norm(linear.B) / max(float(np.linalg.norm(linear.G)), 1e-300) * self._command_size
            intensity = max(0.05 * float(force), 1e-9)
        try:
            gains = [
                design(linear.A, linear.C, linear.G, step, (factor * intensity) ** 2, noise)
                for factor in (1.0, 1.0 / _RIVAL, _RIVAL)
            ]
        except (IdloopError, np.linalg.LinAlgError):
            if not self._designed:
                raise
            return
        self._bank.gain = np.ascontiguousarray(gains[0].gain)
        self._bank.set_rivals([observer.gain for observer in gains[1:]])
        self._rival_cost = np.zeros(3)
        self._rival_age = 0
        self._memory = float(min(gains[0].memory, 500.0))
        self._designed, self._designed_for, self._intensity = True, self.theta.copy(), intensity
        self._bank.place(self.theta, self._steps())

    def _tune(self, innovation: Array) -> bool:
        """Compare the disturbance intensities on the latest block; True when that of a rival is adopted."""
        rows = [innovation, *self._bank.rivals()]
        size = self._innovations.size**2
        self._rival_age += 1
        if self._rival_age > 2:
            for index, row in enumerate(rows):
                power = np.nanmean(np.minimum(row**2, OUTLIER**2 * 4.0 * size) / size)
                self._rival_cost[index] += float(power) if np.isfinite(power) else 1e9
        if self._rival_age < 10:
            return False
        best = int(np.argmin(self._rival_cost))
        # A change must reduce the innovation power by 0.5 %, or the intensity would drift.
        better = self._rival_cost[best] < 0.995 * self._rival_cost[0]
        self._rival_cost[:] = 0.0
        self._rival_age = 2
        if best == 0 or not better:
            return False
        self._disturbance = self._intensity * (_RIVAL if best == 2 else 1.0 / _RIVAL)
        return True

    def _steps(self) -> Array:
        """Difference steps: a tenth of a standard error, within limits relative to the parameter's size."""
        size = np.where(np.isfinite(self._size), self._size, 1e-3)
        if not self.adapt:
            return np.zeros(0)
        step = np.clip(0.1 * self.stderr, 1e-5 * size, 1e-2 * size)
        return np.where(self.theta + step > self._upper, -step, step)

    def _update_parameters(self, used: bool) -> None:
        """Run the moved predictors over the block and make one Gauss-Newton step."""
        if not self.adapt or len(self.theta) == 0:
            self._bank.drop()
            return
        self._find_sizes()
        if self._updates == 0:
            self._first_noise = np.array([noise_std(column) for column in self._bank.measured().T])
        retune = self._tune(self._bank.innovations()) if self._innovations.known else False
        innovation, slope = self._bank.slopes()
        samples = len(innovation)
        if self._updates == 0 and self._disturbance is None and self._bank.command_rms() > 0.0:
            # The first block gives the size of the command, and with it that of a typical disturbance.
            self._command_size = self._bank.command_rms()
            self._noise = np.where(self._first_noise > 0.0, self._first_noise, self._noise)
            self._updates = 1
            self._design()
            return
        if not used or not self._innovations.known:
            self._bank.place(self.theta, self._steps())
            return
        weight, scaled = self._innovations.weigh(innovation)
        slope = np.where(np.isfinite(slope), slope, 0.0)
        # Matrix products are twenty times faster than one einsum of three arrays.
        rows = slope.reshape(-1, slope.shape[2])
        gradient = rows.T @ scaled.ravel()
        hessian = rows.T @ (weight @ slope).reshape(rows.shape)
        if not (np.all(np.isfinite(gradient)) and np.all(np.isfinite(hessian))):
            self._restart()
            return
        keep = np.exp(-samples * (self.sample_time or 0.0) / self.forgetting_time)
        floor = np.diag(1.0 / (self.prior * self._size) ** 2)
        # Forgetting stops at the prior: without excitation the covariance stays bounded.
        self._information = floor + keep * (self._information - floor) + hessian
        scale = 1.0 / np.sqrt(np.diag(self._information))
        move = scale * np.linalg.solve(
            self._information * np.outer(scale, scale) + 1e-12 * np.eye(len(scale)), gradient * scale
        )
        size = np.maximum(self._size, np.abs(self.theta))
        largest = float(np.max(np.abs(move) / size))
        # A block changes no parameter by more than a fifth of its size.
        move *= min(1.0, 0.2 / max(largest, 1e-300))
        self.theta = np.clip(self.theta + move, self._lower + self._margin(self._lower), self._upper)
        self._updates += 1
        if retune or np.any(np.abs(self.theta - self._designed_for) > 0.05 * size):
            self._design()
        else:
            self._bank.place(self.theta, self._steps())

    def _margin(self, lower: Array) -> Array:
        """Least value of inertia and stiffness with a lower bound of 0, which must stay positive."""
        keeps_positive = np.array([n.endswith((".inertia", ".stiffness")) for n in self._model.free])
        return np.where((lower == 0.0) & keeps_positive, 1e-3 * np.nan_to_num(self._size, nan=1.0), 0.0)

    def _find_sizes(self) -> None:
        """Typical size of parameters that start at 0, from their influence on the first block."""
        for index in np.flatnonzero(~np.isfinite(self._size)):
            self._size[index] = self._bank.probe(int(index), self._innovations.size, float(self._upper[index]))
            self._information[index, index] = 1.0 / (self.prior * self._size[index]) ** 2
            self._bank.restep(int(index), self._steps()[index])
