"""The part of a measured motion that the recorded reference or excitation explains."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from idloop.estimate.motion import Motion, differentiate, low_pass

if TYPE_CHECKING:
    from idloop.records import Record

Array = NDArray[np.float64]

# Response to the reference is modelled over this many taps, spaced at the comparison band.
_TAPS = 22
_AHEAD = 2
# A reference that explains less of the acceleration than this is no useful instrument.
_LEAST_SHARE = 0.5


def explained_motion(
    record: Record, motion: Motion, command: Array
) -> tuple[tuple[Array, Array, Array, Array], float] | None:
    """Regress motion and command on the delayed reference and excitation.

    Parameters
    ----------
    record : Record
        With `reference` and `excitation` where they were recorded.
    motion : Motion
        Measured motion.
    command : array, shape (n,)
        Command at the instants of the motion.

    Returns
    -------
    ((position, velocity, acceleration, command), share) or None
        Explained parts, shapes (n, bodies) and (n,), and the smallest share of an
        acceleration's power that is explained. None without a moving reference or
        when that share is too small to carry an estimate.
    """
    sources = _sources(record, motion)
    if not sources:
        return None
    spacing = max(int(1.0 / (2.5 * motion.comparison_band * motion.sample_time)), 1)
    acceleration = np.column_stack([_delayed(source, spacing) for source in sources])
    step = motion.sample_time
    velocity = _integrated(acceleration, step)
    position = _integrated(velocity, step)
    n = len(motion.time)
    ramp = np.linspace(-1.0, 1.0, n)
    trends = np.column_stack([np.ones(n), ramp, ramp**2])
    parts = [
        _projected(acceleration, motion.acceleration),
        _projected(np.column_stack([velocity, trends[:, :1]]), motion.velocity),
        _projected(np.column_stack([position, trends]), motion.position),
    ]
    drive = _projected(np.column_stack([acceleration, velocity, trends[:, :1]]), command[:, None])[:, 0]
    inner = slice(n // 50, n - n // 50)
    left = low_pass(motion.acceleration - parts[0], motion.comparison_band, step)[inner]
    whole = low_pass(motion.acceleration, motion.comparison_band, step)[inner]
    share = float(np.min(1.0 - np.sum(left**2, axis=0) / np.maximum(np.sum(whole**2, axis=0), 1e-300)))
    if share < _LEAST_SHARE:
        return None
    return (parts[2], parts[1], parts[0], drive), share


def _sources(record: Record, motion: Motion) -> list[Array]:
    """Accelerations of the reference, and the excitation as it is, on the motion's grid."""
    sources = []
    for time, values, kinds in (
        (record.reference_time, record.reference, (2,)),
        (record.excitation_time, record.excitation, (2, 0)),
    ):
        if time is None or values is None or len(time) < 10:
            continue
        table = values if values.ndim == 2 else values[:, None]
        for column, order in zip(table.T, kinds, strict=False):
            known = np.isfinite(column)
            if np.sum(known) < 10 or np.ptp(column[known]) <= 0.0:
                continue
            series = np.interp(motion.time, time[known], column[known])
            series = low_pass(series, motion.cutoff, motion.sample_time)
            for _ in range(order):
                series = differentiate(series, motion.sample_time)
            sources.append(series)
    return sources


def _delayed(source: Array, spacing: int) -> Array:
    """The source at a row of delays, some ahead because filters and stamps are not causal."""
    n = len(source)
    columns = np.zeros((n, _TAPS))
    for tap in range(_TAPS):
        lag = (tap - _AHEAD) * spacing
        index = np.clip(np.arange(n) - lag, 0, n - 1)
        columns[:, tap] = source[index]
    return columns


def _integrated(columns: Array, step: float) -> Array:
    mean = 0.5 * (columns[1:] + columns[:-1]) * step
    return np.concatenate([np.zeros((1, columns.shape[1])), np.cumsum(mean, axis=0)])


def _projected(regressors: Array, values: Array) -> Array:
    scale = np.maximum(np.linalg.norm(regressors, axis=0), 1e-300)
    coefficients = np.linalg.lstsq(regressors / scale, values, rcond=1e-8)[0]
    return np.asarray((regressors / scale) @ coefficients)
