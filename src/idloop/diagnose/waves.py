"""Waves over the turn: which harmonics an unexplained force has."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from idloop.estimate.student import weights
from idloop.estimate.weak_fit import WeakFit

Array = NDArray[np.float64]

# The strongest so many are worth a fit.
STRONGEST = 3
# A wave shows when the motion spans so many of its periods, and a period lasts so many windows at typical speed: then
# five sixths of it are left.
_PERIODS, _WINDOWS = 2.0, 1.5
_HIGHEST = 400
# Rows beyond which every n-th tells the same.
_ENOUGH = 20_000


def harmonics(fit: WeakFit, body: int) -> tuple[tuple[int, ...], int]:
    """Harmonics of a turn that a force has most of, strongest first, and how many were looked at.

    Parameters
    ----------
    fit : WeakFit
    body : int
        Whose angle, and whose unexplained force.

    Returns
    -------
    found : tuple of int
        From 2 on; empty where the motion tells of none.
    tried : int
    """
    form = fit.form
    angle = form.along("position", body)
    speed = float(np.median(np.abs(form.along("velocity", body))))
    windows = form.width * form.sample_time * speed / (2.0 * np.pi)
    turns = float(np.ptp(angle)) / (2.0 * np.pi)
    lowest = max(2, int(np.ceil(_PERIODS / max(turns, 1e-12))))
    highest = min(_HIGHEST, int(1.0 / max(_WINDOWS * windows, 1e-12)))
    if highest < lowest:
        return (), 0
    stride = max(len(angle) // _ENOUGH, 1)
    left = fit.residual[::stride, body]
    left = left * weights(left / fit.scale[body])
    turned = np.exp(1j * angle[::stride])
    power, wave = [], turned ** (lowest - 1)
    for _ in range(lowest, highest + 1):
        wave = wave * turned
        power.append(abs(np.vdot(wave, left)))
    return tuple(int(lowest + place) for place in np.argsort(power)[::-1][:STRONGEST]), len(power)
