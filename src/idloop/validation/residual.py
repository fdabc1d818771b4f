"""Residual tests: whiteness of the residual, and its independence of past inputs.

Feedback carries past residuals into the command, so that a coloured residual is correlated with the command even for a
correct model. In closed loop residuals are therefore tested against exogenous signals, the recorded reference or
excitation; where none is recorded, the test is left undecided (Ljung, 2nd ed., section 16.6).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import toeplitz
from scipy.special import chdtrc

from idloop.arrays import Array
from idloop.errors import InputError

INPUT, REFERENCE = "input", "reference"
# Part of a residual's variance worth an effect: what explains it makes the errors 1 % smaller.
_WORTH = 0.02


@dataclass(frozen=True)
class ResidualTest:
    """Autocorrelation of one output's residual, and its correlation with the input or an exogenous signal."""

    name: str  # output the residual belongs to
    lag: Array  # shape (m,): lags 1..m of the autocorrelation, in samples
    # shape (m,): autocorrelation and the half width of its 99 % band for white noise
    autocorrelation: Array
    autocorrelation_band: Array
    # Portmanteau statistic over all lags and its p-value under whiteness
    ljung_box: float
    ljung_box_p: float
    cross_lag: Array  # shape (2 m + 1,): lags −m..m; a positive lag means that the residual follows the input
    # shape (2 m + 1,): correlation between input and residual and the half width of its 99 % band
    cross_correlation: Array
    cross_correlation_band: Array
    cross_p: float  # p-value of independence of all outputs' residuals from past inputs (lags ≥ 1); NaN where undecided
    # parts of the residual's variance that its own past and past inputs explain, what chance adds taken off
    memory_share: float
    cross_share: float
    against: str = INPUT  # tested signal: ``input``, or ``reference`` for exogenous signals of a closed loop

    @property
    def white(self) -> bool:
        """Whether whiteness is not rejected at the 1 % level."""
        return self.ljung_box_p > 0.01

    @property
    def input_free(self) -> bool:
        """Whether independence of residual and past input is not rejected at the 1 % level, or undecided."""
        return not self.cross_p <= 0.01

    @property
    def decided(self) -> bool:
        """Whether the data decide on the independence of residual and input."""
        return bool(np.isfinite(self.cross_p))

    @property
    def coloured(self) -> bool:
        """Whether it is significantly not white, by a part that makes a difference."""
        return not self.white and self.memory_share > _WORTH

    @property
    def follows(self) -> bool:
        """Whether it significantly follows the input, by a part that makes a difference."""
        return not self.input_free and self.cross_share > _WORTH

    @property
    def freedom(self) -> str:
        """Result of the test against the input as the end of a sentence, after "is white and"."""
        if not self.decided:
            return "may be correlated with the command by feedback: record the reference to decide"
        return f"is {'independent of' if self.input_free else 'correlated with'} the {self.against}"

    def to_dict(self) -> dict[str, Any]:
        """Return the verdicts and both correlations as plain numbers for JSON."""
        return {
            "output": self.name,
            "white": bool(self.white),
            "ljung_box": self.ljung_box,
            "ljung_box_p": self.ljung_box_p,
            "input_free": bool(self.input_free),
            "input_correlation_p": self.cross_p if self.decided else None,
            "memory_share": self.memory_share,
            "input_share": self.cross_share if self.decided else None,
            "against": self.against,
            "autocorrelation": self.autocorrelation.tolist(),
            "cross_correlation": self.cross_correlation.tolist(),
        }


def autocorrelation(values: ArrayLike, lags: int) -> Array:
    """Autocorrelation of a series with its mean removed, biased estimate.

    `values` (n,): series without NaN; `lags`: largest lag. Returns shape (lags + 1,): correlation at lags 0..lags; 1 at
    lag 0 (0 everywhere for a constant series).
    """
    e = np.asarray(values, dtype=float)
    return _cross(e, e, lags)[lags:]


def _cross(x: Array, e: Array, lags: int) -> Array:
    """Return corr(x[t − lag], e[t]) for lags −m..m, by FFT."""
    n = len(e)
    x, e = x - x.mean(), e - e.mean()
    scale = float(np.sqrt(np.sum(x**2) * np.sum(e**2)))
    if scale <= 0.0:
        return np.zeros(2 * lags + 1)
    size = 1 << (2 * n - 1).bit_length()
    product = np.fft.irfft(np.fft.rfft(e, size) * np.conj(np.fft.rfft(x, size)), size)
    return np.concatenate([product[size - lags :], product[: lags + 1]]) / scale


def ljung_box(values: ArrayLike, lags: int) -> tuple[float, float]:
    """Portmanteau test of whiteness (Ljung and Box, Biometrika 65, 1978).

    `values` (n,): series without NaN; `lags`: number of lags pooled. Returns `statistic`, `p_value`: ``n (n + 2) Σ r_k²
    / (n − k)`` and its χ²(lags) tail probability.
    """
    e = np.asarray(values, dtype=float)
    n = len(e)
    r = autocorrelation(e, lags)[1:]
    statistic = float(n * (n + 2) * np.sum(r**2 / (n - np.arange(1, lags + 1))))
    return statistic, float(chdtrc(lags, statistic))


def input_residual_test(signal: ArrayLike, residual: ArrayLike, lags: int) -> tuple[Array, Array, float, float]:
    """Cross-correlation of an input with a residual, tested with the spectra of both.

    The variance of a cross-correlation of independent series is
    ``Σ_k r_u(k) r_e(k) / n`` (Bartlett), so that a slow input and a coloured
    residual do not give false alarms. The causal lags are pooled by a Wald
    test with the same covariance, on its well-determined directions only.

    `signal`, `residual` (n,): input and residual at the same instants, without NaN; `lags`: largest lag. Returns
    `correlation` (2 lags + 1,): correlation at lags −lags..lags. `band` (2 lags + 1,): half width of the 99 % band.
    `p_value`: p-value of the pooled test over lags 1..lags. Lag 0 is left out: a measurement comes before the command
    of its stamp, so under feedback the command follows the residual there. `share`: part of the residual's variance
    that these lags explain.
    """
    u, e = np.asarray(signal, dtype=float), np.asarray(residual, dtype=float)
    n = len(e)
    correlation = _cross(u, e, lags)
    reach = min(n - 1, max(10 * lags, 200))
    r_u, r_e = autocorrelation(u, reach), autocorrelation(e, reach)
    # The lag window keeps the variance positive and its own noise small.
    window = 1.0 - np.arange(reach + 1) / (reach + 1)
    kernel = r_u * r_e * window
    product = np.concatenate([kernel[:0:-1], kernel])
    covariance = np.array([_shifted_sum(r_u, r_e * window, k) for k in range(lags)]) / n
    variance = max(float(np.sum(product)) / n, 1.0 / n**2)
    band = np.full(2 * lags + 1, 2.5758293035489004 * np.sqrt(variance))
    causal = correlation[lags + 1 :]
    values, vectors = np.linalg.eigh(toeplitz(covariance))
    keep = values > 1e-3 * values[-1] if values[-1] > 0 else np.zeros(len(values), dtype=bool)
    if not np.any(keep):
        return correlation, band, 1.0, 0.0
    statistic, freedom = float(np.sum((vectors[:, keep].T @ causal) ** 2 / values[keep])), int(np.sum(keep))
    return correlation, band, float(chdtrc(freedom, statistic)), _share(statistic, freedom, n)


def _share(statistic: float, freedom: int, count: int) -> float:
    """Part of a variance behind a χ² statistic of correlations in `count` samples, what chance adds taken off."""
    return min(max(statistic - freedom, 0.0) / count, 1.0)


def _shifted_sum(a: Array, b: Array, shift: int) -> float:
    """Σ_k a(k + shift) b(k) over both signs of k, for even sequences given at k ≥ 0."""
    m = len(a) - 1
    k = np.arange(-m, m + 1)
    moved = np.abs(k + shift)
    inside = moved <= m
    return float(np.sum(a[moved[inside]] * b[np.abs(k[inside])]))


def residual_tests(
    residual: ArrayLike,
    signal: ArrayLike,
    names: tuple[str, ...] | None = None,
    lags: int = 25,
    *,
    outside: Sequence[ArrayLike] = (),
    fed_back: bool = False,
) -> list[ResidualTest]:
    """Whiteness and input-residual tests for every output.

    `residual` (n,): innovations or simulation errors; NaN samples are left out. `signal` (n,): input at the same
    instants. `names`: output names. `lags`: largest lag in samples. `outside` (n,): exogenous signals of a closed loop
    at the same instants: reference, excitation. The residual is tested against these instead of the input. The p-value
    is multiplied by their number and that of the outputs (Bonferroni). `fed_back`: whether the input may carry past
    residuals: then a coloured residual without exogenous signals is not tested. Returns one per output that has enough
    samples. Raises InputError: if lengths differ or there are fewer than ``4 · lags`` samples.
    """
    e = np.asarray(residual, dtype=float)
    e = e[:, None] if e.ndim == 1 else e
    u = np.asarray(signal, dtype=float)
    if len(u) != len(e):
        raise InputError(f"residual has {len(e)} samples and input {len(u)}; sample the input at the output's times")
    if len(e) < 4 * lags:
        raise InputError(f"{len(e)} samples are too few for {lags} lags; give {4 * lags} or fewer lags")
    names = names or tuple(f"output{i}" for i in range(e.shape[1]))
    signals = [np.asarray(one, dtype=float) for one in outside] or [u]
    tests = []
    for column, name in zip(e.T, names, strict=True):
        known = np.isfinite(column)
        if np.sum(known) < 4 * lags:
            continue
        values = column[known]
        statistic, p_value = ljung_box(values, lags)
        tried = [input_residual_test(one[known], values, lags) for one in signals]
        cross, band, cross_p, cross_share = min(tried, key=lambda one: one[2])
        tests.append(
            ResidualTest(
                name=name,
                lag=np.arange(1, lags + 1, dtype=float),
                autocorrelation=autocorrelation(values, lags)[1:],
                autocorrelation_band=np.full(lags, 2.5758293035489004 / np.sqrt(len(values))),
                ljung_box=statistic,
                ljung_box_p=p_value,
                cross_lag=np.arange(-lags, lags + 1, dtype=float),
                cross_correlation=cross,
                cross_correlation_band=band,
                cross_p=min(len(tried) * e.shape[1] * cross_p, 1.0),
                memory_share=_share(statistic, lags, len(values)),
                cross_share=cross_share,
                against=REFERENCE if outside else INPUT,
            )
        )
    if fed_back and not outside and not all(test.white for test in tests):
        return [replace(test, cross_p=float("nan")) for test in tests]
    return tests
