"""How well a fit by force balance explains what it did not see: each half of every record by the rest."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from idloop.estimation.force_balance.weak_fit import WeakFit


def cross_validated_error(fit: WeakFit) -> float:
    """Rms of the unexplained force over that of the drive's force, each half of the records by the other's parameters.

    Parameters of a half are one Gauss-Newton step from those of the whole. The step is exact where the balance is
    linear in them, as in inertia and friction, and costs no further fit.
    """
    error, slopes = fit.residual[:, 0], fit.slopes_of_force
    drive = fit.form.drive(fit.theta, fit.shift)
    edges = fit.form.starts
    first = np.zeros(len(error), dtype=bool)
    for start, stop in pairwise(edges):
        first[start : (start + stop) // 2] = True
    unseen = np.empty_like(error)
    for half in (first, ~first):
        step = np.linalg.lstsq(slopes[half], -error[half], rcond=None)[0]
        unseen[~half] = error[~half] + slopes[~half] @ step
    return float(np.linalg.norm(unseen) / max(float(np.linalg.norm(drive)), 1e-300))
