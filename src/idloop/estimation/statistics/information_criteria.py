"""Information criteria: the loss of a model weighed against the number of its parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from idloop.arrays import Array


@dataclass(frozen=True)
class Information:
    """Loss of a model and its information criteria."""

    loss: float  # determinant V of the covariance of the one-step errors
    free: int  # number d of estimated parameters
    samples: float  # number N of samples

    @property
    def fpe(self) -> float:
        """Akaike's final prediction error V (1 + d/N) / (1 - d/N) (Ljung, 2nd ed., eq. 16.52)."""
        share = self.free / max(self.samples, 1)
        return self.loss * (1 + share) / (1 - share) if share < 1 else float("inf")

    @property
    def aic(self) -> float:
        """Akaike's information criterion N ln V + 2 d, without constants that all models share."""
        return self._logarithm + 2.0 * self.free

    @property
    def bic(self) -> float:
        """Bayesian information criterion N ln V + d ln N."""
        return self._logarithm + self.free * float(np.log(max(self.samples, 1)))

    @property
    def _logarithm(self) -> float:
        return self.samples * float(np.log(max(self.loss, np.finfo(float).tiny)))


def of_errors(errors: Array, free: int) -> Information:
    """Criteria from one-step errors, shape (N, p)."""
    covariance = errors.T @ errors / max(len(errors), 1)
    return Information(float(np.linalg.det(covariance)), free, len(errors))


def comparable(several: Sequence[Information]) -> list[Information]:
    """Criteria of models of the same data, all with the smallest of their numbers of samples.

    Models begin at different samples, and N ln V depends on N and on the unit of the outputs.
    """
    fewest = min((one.samples for one in several), default=0.0)
    return [replace(one, samples=fewest) for one in several]


def independent_share(errors: Array) -> float:
    """Effective number of independent samples of errors (N, p), over N.

    The inverse of the integrated autocorrelation time, summed while neighbouring pairs are positive (Geyer, Statistical
    Science 7, 1992), averaged over the outputs.
    """
    n = len(errors)
    centred = errors - np.mean(errors, axis=0)
    lines = np.fft.rfft(centred, 2 * n, axis=0)
    correlation = np.fft.irfft(np.abs(lines) ** 2, axis=0)[:n]
    times = []
    for column in correlation.T:
        if not column[0] > 0.0:
            continue
        pairs = (column[: n // 2 * 2] / column[0]).reshape(-1, 2).sum(axis=1)
        last = int(np.argmax(pairs <= 0.0)) if np.any(pairs <= 0.0) else len(pairs)
        times.append(max(2.0 * float(np.sum(pairs[:last])) - 1.0, 1.0))
    return 1.0 / float(np.mean(times)) if times else 1.0
