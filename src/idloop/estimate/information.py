"""What a loss is worth beside the numbers that were estimated to get it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Information:
    """Loss of a model and the criteria that follow from it.

    Attributes
    ----------
    loss : float
        Determinant V of the covariance of the one-step errors.
    free : int
        Numbers d that were estimated.
    samples : int
        Samples N that they rest on.
    """

    loss: float
    free: int
    samples: int

    @property
    def fpe(self) -> float:
        """Akaike's final prediction error V (1 + d/N) / (1 - d/N) (Ljung, 2nd ed., eq. 16.52)."""
        share = self.free / max(self.samples, 1)
        return self.loss * (1 + share) / (1 - share) if share < 1 else float("inf")

    @property
    def aic(self) -> float:
        """Akaike's information criterion N ln V + 2 d, without the constants that all models share."""
        return self._logarithm + 2.0 * self.free

    @property
    def bic(self) -> float:
        """Bayesian information criterion N ln V + d ln N."""
        return self._logarithm + self.free * float(np.log(max(self.samples, 1)))

    @property
    def _logarithm(self) -> float:
        return self.samples * float(np.log(max(self.loss, np.finfo(float).tiny)))


def of_errors(errors: Array, free: int) -> Information:
    """Criteria of one-step errors, shape (N, p)."""
    covariance = errors.T @ errors / max(len(errors), 1)
    return Information(float(np.linalg.det(covariance)), free, len(errors))
