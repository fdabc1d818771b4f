"""Polynomial models that follow the data sample by sample."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from idloop.arrays import Array, Mask
from idloop.errors import InputError
from idloop.estimation.polynomial.polynomials import Orders, Polynomials
from idloop.estimation.recursive.step import (
    COUNT,
    FORGETTING,
    INPUTS,
    PROJECTED,
    ROWS_OF_NOISE,
    ROWS_PER_INPUT,
    SCALARS,
    VARIANCE,
    advance,
    spread,
    stable,
)

Method = Literal["gradient", "pseudo-linear"]

NEVER = np.iinfo(np.int64).max
# Lines of a frequency response, and the real part below which C or F hardly are positive real.
_LINES, _POSITIVE = 1024, 0.1
_SILENT = 1e-100  # signals below count as 0: squares of their units would not be numbers


class RecursivePolynomial:
    """Estimate A(q) y = sum_i B_i(q) / F_i(q) u_i + C(q) / D(q) e, one sample at a time.

    A sample costs O(k^2) operations for k coefficients, and memory does not grow. The covariance is kept as
    U D U^T; roots of C and F are kept inside the unit circle by shortening the steps; variances never exceed the
    first ones, so that a quiet plant does not make the estimator forget everything.

    Parameters
    ----------
    method : "gradient" or "pseudo-linear"
        Recursive prediction error method, or pseudo-linear regression (extended least squares), which is simpler
        and converges when 1 / C - 1/2 is positive real. The same for ARX models.
    forgetting : float
        Weight of a sample over that of the next, in (0, 1]; 1 - 1 / n remembers n samples.
    random_walk : float or array, shape (k,), optional
        Standard deviation by which each coefficient moves in one sample [unit of the coefficient]: the Kalman
        filter's way of forgetting, for each coefficient apart.
    drift : float
        The same for all coefficients at once, when every signal is measured in its typical size.
    start : Polynomials or array, shape (k,), optional
        First coefficients; 0 by default.
    prior : float, optional
        The first coefficients weigh as much as 1 / prior^2 samples of signals of typical size: 100 by default for
        ARX models, and 3 for the others, whose first steps must not be too large.
    input_scale, output_scale : float or one per input, float, optional
        Typical sizes of the signals, so that `prior` means the same for every coefficient. Otherwise the samples so
        far determine them, so that units do not matter: the first are processed once more when the root mean square
        of a signal differs from the size in use by a factor of e, and when enough are there.
    warm_up : float, optional
        In [0, 1): the first samples, predicted by a model that is still wrong, are forgotten at the rate 0.95, and
        this is the share of that rate which is left from each sample to the next; 0 for none. By default 0 for
        ARX models, which are exact from the first sample, and 0.995 for the others.
    radius : float
        Circle that the roots of C and F are kept in.
    sample_time : float
        Period [s], for `polynomials`.

    Raises
    ------
    InputError
        Numbers out of range, or a start of other orders.

    References
    ----------
    Ljung and Söderström, Theory and Practice of Recursive Identification, 1983, chapters 3, 5 and 6;
    Ljung, System Identification, 2nd ed., chapter 11.
    """

    def __init__(
        self,
        orders: Orders,
        *,
        method: Method = "gradient",
        forgetting: float = 1.0,
        random_walk: ArrayLike | None = None,
        drift: float = 0.0,
        start: Polynomials | ArrayLike | None = None,
        prior: float | None = None,
        input_scale: float | Sequence[float] | None = None,
        output_scale: float | None = None,
        warm_up: float | None = None,
        radius: float = 0.999,
        sample_time: float = 1.0,
        input_names: tuple[str, ...] | None = None,
        output_name: str = "output",
    ) -> None:
        m = orders.inputs
        numbered = ("input",) if m == 1 else tuple(f"input{i + 1}" for i in range(m))
        names = numbered if input_names is None else input_names
        # Linear regressions are exact from the first sample.
        linear = not (orders.nc or orders.nd or any(orders.nf))
        growth = (0.0 if linear else 0.995) if warm_up is None else float(warm_up)
        width = (100.0 if linear else 3.0) if prior is None else float(prior)
        scales = np.broadcast_to(np.asarray(1.0 if input_scale is None else input_scale, dtype=float), (m,)).copy()
        size = 1.0 if output_scale is None else float(output_scale)
        if len(names) != m:
            raise InputError(f"{len(names)} input names for {m} inputs; give one per input")
        if method not in {"gradient", "pseudo-linear"}:
            raise InputError(f"method {method!r} is unknown; choose 'gradient' or 'pseudo-linear'")
        if not (0.0 < forgetting <= 1.0 and width > 0.0 and 0.0 <= growth < 1.0 and 0.0 < radius <= 1.0):
            raise InputError(
                "forgetting must be in (0, 1], prior above 0, warm_up in [0, 1) and radius in (0, 1];"
                f" they are {forgetting:g}, {width:g}, {growth:g} and {radius:g}"
            )
        if not (np.all(scales > 0.0) and size > 0.0):
            raise InputError("input_scale and output_scale must be above 0; give the typical sizes of the signals")
        self.orders, self.method, self.forgetting = orders, method, float(forgetting)
        self.sample_time, self.input_names, self.output_name = sample_time, tuple(names), output_name
        self.innovation = float("nan")
        self._growth, self._radius = growth, float(radius)
        self._carries = method == "pseudo-linear" and not linear
        walk = np.zeros(orders.size) if random_walk is None else np.asarray(random_walk, dtype=float)
        walk = np.broadcast_to(walk, (orders.size,))
        if not (np.all(np.isfinite(walk)) and np.all(walk >= 0.0)):
            raise InputError("random_walk must be 0 or more for every coefficient")
        if not (np.isfinite(drift) and drift >= 0.0):
            raise InputError(f"drift = {drift:g}; it must be 0 or more")
        self._walk, self._drift, self._start = walk, float(drift), self._first(start)
        self._most = np.full(orders.size, width**2)
        reach = (nb + nk for nb, nk in zip(orders.nb, orders.nk, strict=True))
        lags = max([orders.na, orders.nc, orders.nd, *orders.nf, *reach, 1])
        self._past = np.zeros((INPUTS + ROWS_PER_INPUT * m + ROWS_OF_NOISE, lags + 1))
        # Samples that are kept until they determine the scales.
        self._unknown = np.array([input_scale is None] * m + [output_scale is None])
        self._unscaled = self._unknown.copy()
        self._output_at_rest = False
        self._first_samples = np.zeros((5 * orders.size + 20 if np.any(self._unknown) else 0, m + 1))
        self._held = 0
        counts = [np.array(numbers, dtype=np.int64) for numbers in (orders.nb, orders.nf, orders.nk)]
        self._numbers = (orders.na, orders.nc, orders.nd, *counts)
        self._begin(scales, size)

    def _begin(self, input_scale: Array, output_scale: float) -> None:
        orders = self.orders
        self._input_scale, self._output_scale = input_scale, output_scale
        # Only the coefficients of B have units.
        self._unit = np.ones(orders.size)
        for i in range(orders.inputs):
            self._unit[orders.b(i)] = output_scale / input_scale[i]
        self._theta = self._start / self._unit
        self._steps = (self._walk / self._unit) ** 2 + self._drift**2
        self._past[:] = 0.0
        self._scalars = np.zeros(SCALARS)
        self._upper, self._diagonal = np.eye(orders.size), self._most.copy()
        self._errors = np.diag(self._most) if self._carries else np.zeros((0, 0))
        self._scalars[FORGETTING] = self.forgetting if self._growth == 0.0 else 0.95 * self.forgetting

    # -- results ---------------------------------------------------------------------

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the coefficients, as "a1", "b1[u]"; the number is the lag."""
        return self.orders.names(self.input_names)

    @property
    def coefficients(self) -> Array:
        """Present coefficients in the order of `names`, shape (k,)."""
        return np.asarray(self._theta * self._unit)

    @property
    def covariance(self) -> Array:
        """Covariance of the coefficients, shape (k, k), given the remembered data.

        Of the prediction error method the inverse of the information. Steps of a pseudo-linear regression go along
        the regressor phi and not the gradient psi, so that errors follow (I - K psi^T) from sample to sample: their
        covariance is carried along with the gains K that were taken.
        """
        if len(self._errors):
            scaled = self._scalars[VARIANCE] * self._errors
        else:
            scaled = spread(self._scalars) * (self._upper * self._diagonal) @ self._upper.T
        return np.asarray(scaled * np.outer(self._unit, self._unit))

    @property
    def stderr(self) -> Array:
        """Standard errors, shape (k,)."""
        return np.asarray(np.sqrt(np.maximum(np.diag(self.covariance), 0.0)))

    @property
    def innovation_variance(self) -> float:
        """Variance of the innovations [output unit squared]."""
        return float(self._scalars[VARIANCE]) * self._output_scale**2

    @property
    def slow(self) -> bool:
        """Whether a pseudo-linear regression nears its model too slowly for standard errors that hold.

        They hold where C and F are positive real. In simulations beside that limit what is left of the start
        outweighs the noise in records of any usual length; it is no part of a covariance.
        """
        if not self._carries:
            return False
        places = [self.orders.c, *(self.orders.f(i) for i in range(self.orders.inputs))]
        tails = [self.coefficients[place] for place in places]
        return any(np.min(np.fft.rfft([1.0, *tail], _LINES).real) < _POSITIVE for tail in tails)

    @property
    def samples(self) -> int:
        """Measurements that were used."""
        return int(self._scalars[COUNT])

    @property
    def projections(self) -> int:
        """How often a step was shortened to keep the predictor stable."""
        return int(self._scalars[PROJECTED])

    @property
    def polynomials(self) -> Polynomials:
        """The present model."""
        return Polynomials.from_vector(
            self.orders, self.coefficients, sample_time=self.sample_time, input_names=self.input_names,
            output_name=self.output_name, variance=self.innovation_variance, covariance=self.covariance,
        )  # fmt: skip

    # -- updates ---------------------------------------------------------------------

    def update(self, u: ArrayLike, y: float) -> float:
        """Take one sample, as `update_block`, and return its innovation [output unit]."""
        row = np.asarray(u, dtype=float).reshape(1, -1)
        return float(self.update_block(row, np.array([y], dtype=float))[0])

    def update_block(self, u: ArrayLike, y: ArrayLike) -> Array:
        """Take several samples at once: the same as one after the other.

        Parameters
        ----------
        u : array, shape (n, m), or (n,) for one input
            Commands at the instants of the measurements, in force until the next; NaN is the one before.
        y : array, shape (n,)
            Measurements; NaN where there is none, which is predicted and updates nothing.

        Returns
        -------
        ndarray, shape (n,)
            Innovations: the measurements less their predictions from everything before [output unit].

        Raises
        ------
        InputError
            Shapes that do not suit the model, or infinite samples.
        """
        innovations, _, _ = self._advance(u, y, NEVER)
        return innovations

    def follow(self, u: ArrayLike, y: ArrayLike, every: int = 1) -> tuple[Array, Array, Array]:
        """Take samples as `update_block`, and remember coefficients and standard errors after each `every` of them.

        Returns
        -------
        innovations : ndarray, shape (n,)
        values, stderr : ndarray, shape (n // every, k)
        """
        if every < 1:
            raise InputError(f"every = {every}; it must be at least 1 sample")
        innovations, values, variances = self._advance(u, y, every)
        return innovations, values, np.sqrt(np.maximum(variances, 0.0))

    def forget_signals(self) -> None:
        """Begin another experiment: the past signals count as 0, the coefficients stay."""
        self._end_start()
        self._past[:] = 0.0
        self._held = 0

    # -- inside -----------------------------------------------------------------------

    def _advance(self, u: ArrayLike, y: ArrayLike, every: int) -> tuple[Array, Array, Array]:
        outputs = np.atleast_1d(np.asarray(y, dtype=float))
        inputs = np.asarray(u, dtype=float)
        inputs = inputs.reshape(-1, 1) if inputs.ndim < 2 and self.orders.inputs == 1 else np.atleast_2d(inputs)
        if outputs.ndim != 1 or inputs.shape != (len(outputs), self.orders.inputs):
            raise InputError(
                f"input of shape {np.shape(u)} and output of shape {np.shape(y)};"
                f" give (n, {self.orders.inputs}) and (n,)"
            )
        if np.any(np.isinf(inputs)) or np.any(np.isinf(outputs)):
            raise InputError("input or output holds infinite samples; give NaN where nothing was measured")
        innovations = np.empty(len(outputs))
        rows = len(outputs) // every
        values, variances = np.empty((rows, self.orders.size)), np.empty((rows, self.orders.size))
        done = 0
        while done < len(outputs):
            written = done // every
            starting = self._held < len(self._first_samples)
            at_rest = (
                self._until_output_moves(inputs[done:], outputs[done:]) if starting and self._output_at_rest else 0
            )
            starting &= at_rest == 0
            count = at_rest or (1 if starting else self._until_input_moves(inputs[done:]))
            part, row = slice(done, done + count), slice(written, (done + count) // every)
            offset = done - written * every
            take = self._take_first if starting else self._run
            innovations[part] = take(inputs[part], outputs[part], values[row], variances[row], every, offset)
            done += count
        if len(innovations):
            self.innovation = float(innovations[-1])
        return innovations, values, variances

    def _run(self, inputs: Array, outputs: Array, values: Array, variances: Array, every: int, offset: int) -> Array:
        innovations = np.empty(len(outputs))
        advance(
            *self._numbers, self._theta, self._upper, self._diagonal, self._errors, self._past, self._scalars,
            np.ascontiguousarray(inputs / self._input_scale), outputs / self._output_scale, self.forgetting,
            self._growth, self._steps, self._most, self.method == "gradient", self._radius,
            innovations, values, variances, every, offset,
        )  # fmt: skip
        values *= self._unit
        variances *= self._unit**2
        return np.asarray(innovations * self._output_scale)

    def _take_first(
        self, inputs: Array, outputs: Array, values: Array, variances: Array, every: int, offset: int
    ) -> Array:
        """Take one of the samples that determine the scales, as `_run`; its command is known before its prediction."""
        row = self._first_samples[self._held]
        row[:-1], row[-1] = inputs[0], np.nan
        self._resize(self._held + 1, self._held)
        innovations = self._run(inputs, outputs, values, variances, every, offset)
        row[-1] = outputs[0]
        self._held += 1
        if self._held == len(self._first_samples):
            self._end_start()
        elif self._resize(self._held, self._held) and len(values):
            values[0], variances[0] = self.coefficients, np.diag(self.covariance)
        return innovations

    def _sizes(self, samples: Array) -> tuple[Array, Mask]:
        """Sizes of the signals: given, measured on these samples, or as they were; and which were measured."""
        present = np.array([*self._input_scale, self._output_scale])
        known = np.isfinite(samples)
        size = np.sqrt(np.sum(np.where(known, samples, 0.0) ** 2, axis=0) / np.maximum(known.sum(axis=0), 1))
        measured_now = self._unknown & (size > _SILENT)
        return np.where(measured_now, size, present), measured_now

    def _resize(self, count: int, replayed: int) -> bool:
        """Process the first samples once more where their sizes differ from those in use."""
        present = np.array([*self._input_scale, self._output_scale])
        sizes, measured_now = self._sizes(self._first_samples[:count])
        # Whole samples of equal size have rational ratios: e is none, so that rounding decides nothing.
        if not np.any(measured_now & (self._unscaled | (np.abs(np.log(sizes / present)) > 1.0))):
            return False
        self._unscaled &= ~measured_now
        self._replay(self._first_samples[:replayed], sizes)
        return True

    def _end_start(self) -> None:
        """End the phase of the first samples, unless the output has not moved yet."""
        if not self._held:
            return
        _, measured_now = self._sizes(self._first_samples[: self._held])
        self._output_at_rest = bool(self._unknown[-1] and not measured_now[-1])
        if self._output_at_rest:
            self._keep(self._first_samples[: self._held])
        else:
            self._rescale()

    def _keep(self, samples: Array) -> None:
        """Hold the newest of these samples as the first."""
        self._held = min(len(self._first_samples) // 2, len(samples))
        self._first_samples[: self._held] = samples[len(samples) - self._held :].copy()

    def _until_output_moves(self, inputs: Array, outputs: Array) -> int:
        """Samples that can be run at once: up to the first in which the output moves for the first time."""
        moving = np.flatnonzero(np.isfinite(outputs) & (np.abs(outputs) > _SILENT))
        count = int(moving[0]) if len(moving) else len(outputs)
        newest = np.column_stack([inputs[:count], outputs[:count]])[-len(self._first_samples) :]
        self._keep(np.concatenate([self._first_samples[: self._held], newest]))
        self._output_at_rest = count == len(outputs)
        return count

    def _rescale(self) -> None:
        """Process the first samples once more, in the sizes that they show."""
        samples = self._first_samples[: self._held]
        self._first_samples, self._held = np.zeros((0, samples.shape[1])), 0
        sizes, measured_now = self._sizes(samples)
        self._unscaled &= ~measured_now
        self._replay(samples, sizes)

    def _replay(self, samples: Array, sizes: Array) -> None:
        self._begin(sizes[:-1].copy(), float(sizes[-1]))
        nothing = np.empty((0, self.orders.size))
        self._run(samples[:, :-1], samples[:, -1], nothing, nothing, NEVER, 0)

    def _until_input_moves(self, inputs: Array) -> int:
        """Samples that can be run at once: up to the first in which an input moves for the first time."""
        if not np.any(self._unscaled):
            return len(inputs)
        moving = self._unscaled[:-1] & np.isfinite(inputs) & (np.abs(inputs) > _SILENT)
        rows = np.flatnonzero(np.any(moving, axis=1))
        if len(rows) == 0:
            return len(inputs)
        if rows[0] > 0:
            return int(rows[0])
        for i in np.flatnonzero(moving[0]):
            self._admit(int(i), abs(float(inputs[0, i])))
        return self._until_input_moves(inputs)

    def _admit(self, index: int, size: float) -> None:
        """Scale an input by its first value: its coefficients are still unknown, so only their units change."""
        place = self.orders.b(index)
        self._unscaled[index] = False
        self._input_scale[index] = size
        self._unit[place] = self._output_scale / size
        self._theta[place] = self._start[place] / self._unit[place]
        self._steps[place] = (self._walk[place] / self._unit[place]) ** 2 + self._drift**2

    def _first(self, start: Polynomials | ArrayLike | None) -> Array:
        if start is None:
            return np.zeros(self.orders.size)
        if isinstance(start, Polynomials) and start.orders != self.orders:
            raise InputError(f"start has the orders {start.orders}, the estimator {self.orders}; give the same")
        vector = start.vector if isinstance(start, Polynomials) else np.asarray(start, dtype=float)
        if vector.shape != (self.orders.size,):
            raise InputError(f"start of shape {vector.shape}; it must hold {self.orders.size} coefficients")
        places = [self.orders.c, *(self.orders.f(i) for i in range(self.orders.inputs))]
        if not all(stable(np.ascontiguousarray(vector[place]), self._radius) for place in places):
            raise InputError(f"start: C or F has roots outside the circle of radius {self._radius:g}; reflect them")
        return np.array(vector, dtype=float)
