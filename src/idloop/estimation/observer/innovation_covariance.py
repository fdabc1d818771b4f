"""Running covariance of innovations, and robust weights from it."""

from __future__ import annotations

import numpy as np

from idloop.arrays import Array

# Innovations above so many standard deviations get less weight.
OUTLIER = 5.0
# Innovations above so many standard deviations show that the predictor has diverged.
_DIVERGED = 1e4
# Samples over which the covariance is averaged.
_MEMORY = 5000


class InnovationCovariance:
    """Running covariance of the innovations.

    Attributes: `value` (p, p): NaN until the first samples.
    """

    def __init__(self, outputs: int) -> None:
        self.value: Array = np.full((outputs, outputs), np.nan)
        self._samples = 0

    @property
    def known(self) -> bool:
        """Whether there have been any samples."""
        return bool(np.all(np.isfinite(self.value)))

    @property
    def size(self) -> Array:
        """Standard deviation of every output's innovation, shape (p,)."""
        return np.asarray(np.sqrt(np.maximum(np.diag(self.value), 1e-300)))

    def update(self, innovation: Array) -> None:
        """Add innovations of shape (n, p); rows with a NaN are left out."""
        rows = innovation[np.all(np.isfinite(innovation), axis=1)]
        if len(rows) == 0:
            return
        block = rows.T @ rows / len(rows)
        if not self.known:
            self._samples = len(rows)
            self.value = block + 1e-24 * np.eye(len(block))
            return
        # Bursts of outliers do not change the noise level.
        if np.trace(block) > 100.0 * OUTLIER**2 * np.trace(self.value):
            return
        # At first the mean of all samples, later exponential forgetting.
        self._samples += len(rows)
        share = len(rows) / min(self._samples, _MEMORY)
        self.value = (1.0 - share) * self.value + share * block

    def diverged(self, innovation: Array) -> bool:
        """Whether innovations are so large that the predictor must be restarted."""
        with np.errstate(invalid="ignore"):
            return self.known and bool(np.any(np.abs(innovation) > _DIVERGED * self.size))

    def weigh(self, innovation: Array) -> tuple[Array, Array]:
        """Weights for least squares: less for outliers, none for missing outputs."""
        known = np.isfinite(innovation)
        n, p = innovation.shape
        filled = np.where(known, innovation, 0.0)
        weight = np.broadcast_to(np.linalg.pinv(self.value, rcond=1e-12, hermitian=True), (n, p, p)).copy()
        partial = ~np.all(known, axis=1)
        if np.any(partial):
            alone = known[partial] / self.size**2
            weight[partial] = alone[:, :, None] * np.eye(p)
        weighted = np.einsum("npq,nq->np", weight, filled)
        size = np.sqrt(np.maximum(np.einsum("np,np->n", filled, weighted), 1e-300))
        pull = np.minimum(1.0, OUTLIER * np.sqrt(p) / size)
        return weight * pull[:, None, None], weighted * pull[:, None]
