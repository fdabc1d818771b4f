"""The extended Kalman filter that estimates the state and the coefficients together."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from idloop.errors import InputError
from idloop.estimation.polynomial.orders import Orders
from idloop.estimation.polynomial.polynomials import Polynomials
from idloop.estimation.recursive.estimator import NEVER, RecursivePolynomial
from idloop.estimation.recursive.first_samples import start_from
from idloop.estimation.recursive.joint_step import FIT, JOINT_SCALARS, LOGARITHMS, LOST, joint_advance, restart
from idloop.estimation.recursive.step import stable

Array = NDArray[np.float64]

# Relative to the size of the output: before the first samples have told, and the least that is believed. A filter that
# trusts its first samples more runs away in some starts: its linearization does not hold yet.
_UNTOLD, _LEAST = 1.0, 1e-4
# Samples after which the wander of a coefficient weighs as much as what has been learnt of it.
_MEMORY = 1e5
# Times its standard error by which the start from the first samples may be wrong: they are gone over once more.
_DOUBT = 10.0
# Shares of the noise that may be in the equation, the rest in the sensor: the likeliest is believed in.
_SHARES = (0.0, 0.03, 0.1, 0.3, 0.6, 0.9, 1.0)
_FIRST = 400  # samples that are looked at before a noise is believed in, at most


class ExtendedKalman(RecursivePolynomial):
    """Estimate the state and the coefficients of a model in observer canonical form together, sample by sample.

    The model is, for k = 1 ... s, with s the larger of na and nb, and coefficients that walk slowly at random,

        x_k(t) = -a_k x_1(t-1) + x_(k+1)(t-1) + sum_i b_ik u_i(t - nk_i) + w_k(t),    y(t) = x_1(t) + v(t).

    Ljung (1979) shows what becomes of this filter when the coefficients are constant: it follows a differential
    equation whose rest points are the true coefficients only where the covariances of w and v are those of the
    data. Where they are wrong the estimates are biased, and may diverge, because the filter does not know that its
    gain depends on the coefficients. `recursive_prediction_error` estimates the gain too and has no such bias.
    Without process noise the gain goes to 0, and with it that cause of bias. Standard errors leave the bias out.

    The covariance is kept as U D U^T, so that it stays positive; a sample costs O((s + k)^3) operations.

    Parameters
    ----------
    orders : Orders
        na, nb and nk; the others must be 0.
    process_noise : float or array, shape (s,), optional
        Standard deviation of w [output unit]; a number is that of w_1, the equation error of ARX models. By default
        that under which the first samples are likeliest, and so for `measurement_noise`.
    measurement_noise : float, optional
        Standard deviation of v [output unit], above 0.
    random_walk : float or array, shape (k,), optional
        Standard deviation by which each coefficient moves in one sample [unit of the coefficient].
    drift : float, optional
        The same for all coefficients at once, when every signal is measured in its typical size. By default, without
        `random_walk`, the noise of the output over 1e5: what is older than so many samples counts little.
    forgetting : float
        Weight of a sample over that of the next for the coefficients, in (0, 1].
    start : Polynomials or array, shape (k,), optional
        First coefficients of A and B; otherwise those of least squares on the first samples, which are gone over
        once more.
    prior : float
        Standard deviation of the first coefficients, when every signal is measured in its typical size.
    radius : float
        Circle that the poles are kept in; above 1, so that an integrator is followed.
    **options
        Scales, names and the period, as of `RecursivePolynomial`.

    Raises
    ------
    InputError
        Numbers out of range, or a structure with C, D or F.

    References
    ----------
    L. Ljung, "Asymptotic behavior of the extended Kalman filter as a parameter estimator for linear systems", IEEE
    Transactions on Automatic Control 24, 1979, pages 36 to 50.
    """

    def __init__(
        self,
        orders: Orders,
        *,
        process_noise: ArrayLike | None = None,
        measurement_noise: float | None = None,
        random_walk: ArrayLike | None = None,
        drift: float | None = None,
        forgetting: float = 1.0,
        start: Polynomials | ArrayLike | None = None,
        prior: float = 3.0,
        radius: float = 1.01,
        **options: Any,
    ) -> None:
        if orders.nc or orders.nd or any(orders.nf):
            raise InputError("an extended Kalman filter has polynomials A and B only; give na, nb and nk")
        if not 0.0 < radius < 2.0:
            raise InputError(f"radius = {radius:g}; it must be in (0, 2)")
        if measurement_noise is not None and not (np.isfinite(measurement_noise) and measurement_noise > 0.0):
            raise InputError(f"measurement_noise = {measurement_noise:g}; it must be above 0")
        self._states = max(orders.na, *orders.nb, 1)
        self._process = None if process_noise is None else self._of_states(process_noise)
        self._measurement = measurement_noise
        self._walks = random_walk is not None or drift is not None
        self._prior = float(prior)
        self._told: tuple[float, float] | None = None
        self._doubt: Array | None = None
        if isinstance(start, Polynomials):
            self._same(start, orders)
            start = start.vector[: orders.size]
        self._started = start is not None
        super().__init__(
            orders, random_walk=random_walk, drift=0.0 if drift is None else drift, forgetting=forgetting, start=start,
            prior=prior, warm_up=0.0, **options,
        )  # fmt: skip
        self._radius = float(radius)
        known = self._started and self._process is not None and measurement_noise is not None
        if not known or len(self._first_samples):
            self._first_samples = np.zeros((min(40 * orders.size + 80, _FIRST) + max(orders.nk), orders.inputs + 1))

    def _of_states(self, deviation: ArrayLike) -> Array:
        given = np.asarray(deviation, dtype=float)
        if given.shape not in {(), (self._states,)} or not (np.all(np.isfinite(given)) and np.all(given >= 0.0)):
            raise InputError(f"process_noise must be 0 or more, one number or {self._states}, one per state")
        return np.concatenate([given.reshape(1), np.zeros(self._states - 1)]) if given.ndim == 0 else given

    @staticmethod
    def _same(start: Polynomials, orders: Orders) -> None:
        own = start.orders
        if (own.na, own.nb, own.nk) != (orders.na, orders.nb, orders.nk):
            raise InputError(f"start has the orders {own}, the estimator {orders}; give the same")

    def _begin(self, input_scale: Array, output_scale: float) -> None:
        super()._begin(input_scale, output_scale)
        k, s = self.orders.size, self._states
        told = self._told or ((_UNTOLD * output_scale) ** 2, 0.0)
        process = np.zeros(s)
        process[0] = told[0]
        if self._process is not None:
            process = self._process**2
        measurement = told[1] if self._measurement is None else self._measurement**2
        self._noise = np.zeros(s + k)
        self._noise[:s] = process / output_scale**2
        # Least of all a sensor resolves about so much, and a filter that believes in none is too sure of itself.
        floor = _LEAST**2 if self._measurement is None else 0.0
        self._measured = max(measurement / output_scale**2, floor)
        total = float(np.sum(self._noise[:s])) + self._measured
        self._noise[s:] = self._steps if self._walks else total / _MEMORY**2
        self._most = np.concatenate([np.full(s, LOST**2), np.full(k, self._prior**2)])
        self._state = np.zeros(s)
        self._upper, self._diagonal = np.eye(s + k), self._most.copy()
        if self._doubt is not None:
            self._diagonal[s:] = np.clip((self._doubt / self._unit) ** 2, _LEAST**2, self._prior**2)
        restart(self._state, self._upper, self._diagonal)
        self._scalars = np.zeros(JOINT_SCALARS)
        self._commands = np.zeros((self.orders.inputs, max(self.orders.nk) + 1))

    # -- what it knows ----------------------------------------------------------------

    @property
    def state(self) -> Array:
        """State after the last sample [output unit], shape (s,)."""
        return np.asarray(self._state * self._output_scale)

    @property
    def process_noise(self) -> Array:
        """Standard deviation of w that is believed in [output unit], shape (s,)."""
        return np.asarray(np.sqrt(self._noise[: self._states]) * self._output_scale)

    @property
    def measurement_noise(self) -> float:
        """Standard deviation of v that is believed in [output unit]."""
        return float(np.sqrt(self._measured)) * self._output_scale

    @property
    def covariance(self) -> Array:
        """Covariance of the coefficients, shape (k, k), times what the innovations say of the noises' size."""
        upper, diagonal = (one[self._states :] for one in (self._upper[:, self._states :], self._diagonal))
        fit = self._scalars[FIT] if self.samples else 1.0
        return np.asarray(fit * ((upper * diagonal) @ upper.T) * np.outer(self._unit, self._unit))

    @property
    def polynomials(self) -> Polynomials:
        """The present model with the filter's stationary gain: C holds the gain added to A, and errs as A does."""
        orders, s = self.orders, self._states
        vector, own = self.coefficients, self.covariance
        tail = np.zeros(s)
        tail[: orders.na] = vector[: orders.na]
        c = tail + stationary_gain(tail, self._noise[:s], self._measured)
        also = np.zeros((orders.size + s, orders.size))
        also[: orders.size] = np.eye(orders.size)
        also[orders.size : orders.size + orders.na, : orders.na] = np.eye(orders.na)
        whole = Orders(orders.na, orders.nb, s, 0, orders.nf, orders.nk)
        return Polynomials.from_vector(
            whole, np.concatenate([vector, c]), sample_time=self.sample_time, input_names=self.input_names,
            output_name=self.output_name, variance=self.innovation_variance, covariance=also @ own @ also.T,
        )  # fmt: skip

    # -- what it does -----------------------------------------------------------------

    def forget_signals(self) -> None:
        """Begin another experiment: commands before it count as 0, the state is unknown, the coefficients stay."""
        super().forget_signals()
        self._commands[:] = 0.0
        restart(self._state, self._upper, self._diagonal)

    def widen(self) -> None:
        """Make the coefficients as uncertain as their prior, as after a tool change; their values stay."""
        self._end_start()
        self._upper, self._diagonal = np.eye(len(self._most)), self._most.copy()
        restart(np.zeros(self._states), self._upper, self._diagonal)

    # -- inside -----------------------------------------------------------------------

    def _run(self, inputs: Array, outputs: Array, values: Array, variances: Array, every: int, offset: int) -> Array:
        innovations = np.empty(len(outputs))
        na, (nb, nk) = self.orders.na, (self._numbers[3], self._numbers[5])
        joint_advance(
            na, nb, nk, self._state, self._theta, self._upper, self._diagonal, self._commands, self._scalars,
            np.ascontiguousarray(inputs / self._input_scale), outputs / self._output_scale, self._noise,
            self._measured, self.forgetting, self._most, self._radius, innovations, values, variances, every, offset,
        )  # fmt: skip
        values *= self._unit
        variances *= self._unit**2
        return np.asarray(innovations * self._output_scale)

    def _admit(self, index: int, size: float) -> None:
        super()._admit(index, size)
        if self._walks:
            self._noise[self._states :] = self._steps

    def _rescale(self) -> None:
        samples = self._first_samples[: self._held]
        told = start_from(samples[:, :-1], samples[:, -1], self.orders)
        if told is not None and not self._started:
            self._start, self._doubt = told.vector, _DOUBT * told.stderr
            poles = self._start[self.orders.a]
            while not stable(np.ascontiguousarray(poles), 0.999 * self._radius):
                # From outside the circle no step would lead in.
                poles *= 0.99 ** np.arange(1, self.orders.na + 1)
        super()._rescale()
        if told is None or (self._process is not None and self._measurement is not None):
            return
        scores = [self._score(samples, share * told.process, (1.0 - share) * told.measurement) for share in _SHARES]
        _, fit, noises = min(scores)
        if self._process is None and self._measurement is None:
            noises = (fit * noises[0], fit * noises[1])
        self._score(samples, *noises)

    def _score(self, samples: Array, process: float, measurement: float) -> tuple[float, float, tuple[float, float]]:
        """Go over the first samples with these variances: how unlikely they are, up to the size of the noise."""
        self._told = (process, measurement)
        self._begin(self._input_scale, self._output_scale)
        nothing = np.empty((0, self.orders.size))
        self._run(samples[:, :-1], samples[:, -1], nothing, nothing, NEVER, 0)
        fit = float(self._scalars[FIT])
        unlikely = np.log(max(fit, 1e-300)) + self._scalars[LOGARITHMS] / max(self.samples, 1)
        return float(unlikely), fit, self._told


def stationary_gain(a: Array, noise: Array, measurement: float) -> Array:
    """Gain of the stationary one-step predictor of the state, shape (s,), by running its Riccati equation.

    `a` (s,): tail of A, with zeros up to the number of states; `noise` (s,): variances of the process noise;
    `measurement`: variance of the measurement noise, above 0.
    """
    size = len(a)
    forward = np.eye(size, k=1)
    forward[:, 0] -= a
    spread = np.eye(size) * (measurement + np.max(noise))
    gain = np.zeros(size)
    for _ in range(5000):
        before = gain
        total = spread[0, 0] + measurement
        gain = forward @ spread[:, 0] / total
        spread = forward @ spread @ forward.T - total * np.outer(gain, gain)
        spread = 0.5 * (spread + spread.T) + np.diag(noise)
        if np.max(np.abs(gain - before)) < 1e-10:
            break
    return gain
