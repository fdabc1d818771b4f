"""Collinear command signals, and the note on them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from idloop.arrays import Array, Mask
from idloop.estimation.black_box.sampled import SampledData

if TYPE_CHECKING:
    from idloop.estimation.linear.model import LinearModel


_SINGULAR = 1e-8  # relative singular value of the signals that counts as zero
_PART = 1e-6  # least part of a signal in a singular direction
_INFLATED = 100.0  # variance inflation, as at a correlation of 0.995, below which commands are not collinear
_UNCERTAIN = 0.15  # least uncertainty of one command's effect, as a part of the common effect, that gives a note
_MOST_PERCENT = 1000.0  # largest uncertainty in the text [%]
_MOST_LAGS = 8
_MOST_WINDOWS = 20_000
_EMPTY = 1e-6  # relative singular value of the windows that counts as zero


def any_collinear(signals: Array) -> bool:
    """Whether some of several signals, shape (n, k), are a combination of the others at every sample."""
    return bool(np.any(collinear_inputs(signals)))


def collinear_inputs(signals: Array) -> Mask:
    """Which of several signals, shape (n, k), are a combination of others at every sample, shape (k,)."""
    size = np.linalg.norm(signals, axis=0)
    if signals.shape[1] < 2 or not np.all(size > 0.0):
        return np.zeros(signals.shape[1], dtype=bool)
    _, values, directions = np.linalg.svd(np.linalg.qr(signals / size, mode="r"))
    values = np.concatenate([values, np.zeros(len(directions) - len(values))])
    return np.asarray(np.any(np.abs(directions[values <= _SINGULAR]) > _PART, axis=0))


def collinearity_notes(data: Sequence[SampledData], model: LinearModel) -> tuple[str, ...]:
    """A note where the effects of some inputs cannot be separated: these are collinear, or nearly so beside the noise.

    The variance of an input's coefficients is inflated by the mean of 1 / (1 - rho^2) over the canonical correlations
    rho of its past with that of the others. It is compared with the power of the one-step prediction from the inputs.

    `model`: identified from them.
    """
    names = data[0].input_names
    if len(names) < 2:
        return ()
    together = collinear_inputs(np.vstack([one.input for one in data]))
    if np.any(together):
        those = [name for name, one in zip(names, together, strict=True) if one]
        return (f"{', '.join(those)} move together: only their common effect is known; excite them apart",)
    inflation, directions = _inflation(data, min(max(model.order, 1), _MOST_LAGS))
    if not np.any(inflation > _INFLATED):
        return ()
    power = _power_over_noise(data, model)
    uncertain = np.sqrt(inflation * directions / power) if power > 0.0 else np.zeros(len(names))
    alike = (inflation > _INFLATED) & (uncertain > _UNCERTAIN)
    if not np.any(alike):
        return ()
    alone = ", ".join(name for name, one in zip(names, alike, strict=True) if one)
    share = min(100.0 * float(np.max(uncertain[alike])), _MOST_PERCENT)
    return (
        (
            f"{alone} move nearly together: in this noise the effect of each alone is uncertain by {share:.0f} % of"
            " their common effect or more; excite them apart or record longer"
        ),
    )


def _inflation(data: Sequence[SampledData], lags: int) -> tuple[Array, Array]:
    """Variance inflation of each input's coefficients, shape (m,), and their number."""
    long = [one.input for one in data if len(one) > lags]
    inputs = data[0].input.shape[1]
    if not long:
        return np.ones(inputs), np.ones(inputs)
    step = max(sum(map(len, long)) // _MOST_WINDOWS, 1)
    windows = np.concatenate([sliding_window_view(one - np.mean(one, axis=0), lags, axis=0)[::step] for one in long])
    bases = []
    for index in range(inputs):
        left, sizes, _ = np.linalg.svd(windows[:, index], full_matrices=False)
        # Directions of rounding are left out.
        bases.append(left[:, sizes > _EMPTY * sizes[0]])
    _, sizes, right = np.linalg.svd(np.hstack(bases), full_matrices=False)
    variance = np.sum((right / np.maximum(sizes, _SINGULAR)[:, None]) ** 2, axis=0)
    counts = np.array([base.shape[1] for base in bases])
    means = [float(np.mean(part)) if part.size else 1.0 for part in np.split(variance, np.cumsum(counts)[:-1])]
    return np.array(means), counts.astype(float)


def _power_over_noise(data: Sequence[SampledData], model: LinearModel) -> float:
    """Power of the one-step prediction of the outputs from the inputs, over that of the innovations."""
    from idloop.estimation.linear.propagate import respond

    noise = np.diag(model.covariance)
    used = noise > 0.0
    if not np.any(used):
        return np.inf
    closed, driven = model.a - model.gain @ model.c, model.b - model.gain @ model.d
    power = 0.0
    with np.errstate(all="ignore"):
        for one in data:
            part = respond(closed, driven, model.c, model.d, np.zeros(model.order), np.ascontiguousarray(one.input))
            power += float(np.sum(part[:, used] ** 2 / noise[used]))
    return power
