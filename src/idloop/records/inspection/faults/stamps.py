"""Stamps that are not the times of the samples: the motion is smoother over the number of the sample than over them.

A sampler takes its samples at even times; the network, the operating system or the recorder delays the messages, and
each by another time. Where the axis moves, a wrong stamp shows as a jump of its speed.
"""

from __future__ import annotations

import numpy as np

from idloop.records.finding import Finding
from idloop.records.inspection.axis import Axis
from idloop.records.inspection.faults.fault import fault

# Scatter of the stamps that is worth a look, and intervals that count as lost samples, in periods.
_JITTER, _LOST = 0.03, 1.6
# Steps of the sensor that the axis passes in a sample.
_STEPS = 6.0
# The motion is smoother over even times by this factor, at this share of the samples.
_SMOOTHER, _MOSTLY, _ERRORS = 0.6, 0.6, 6.0
_FEWEST = 100


def check(axis: Axis) -> list[Finding]:
    """Compare the bends of the motion over the stamps with those over even times."""
    field = "position" if axis.place is not None else "velocity"
    value = axis.place if axis.place is not None else axis.velocity
    if value is None:
        return []
    known = np.isfinite(value)
    time, value = axis.time[known], value[known]
    if time.size < _FEWEST:
        return []
    before, after = np.diff(time)[:-1], np.diff(time)[1:]
    period = axis.period
    whole = (np.maximum(before, after) < _LOST * period) & (np.minimum(before, after) > 0.0)
    # Independent errors of three stamps make the difference of two intervals.
    jitter = float(np.sqrt(np.mean(((before - after)[whole] / period) ** 2) / 6.0)) if whole.any() else 0.0
    if whole.sum() < _FEWEST or jitter < _JITTER:
        return []
    rise, fall = np.diff(value)[:-1], np.diff(value)[1:]
    # Only where the motion is fast enough for a wrong stamp to show.
    fast = whole & (np.abs(rise + fall) >= np.median(np.abs(rise + fall)[whole]))
    fast &= np.minimum(np.abs(rise), np.abs(fall)) > _STEPS * axis.resolution[field]
    if fast.sum() < _FEWEST // 2:
        return []
    over_stamps = np.abs(rise[fast] * after[fast] - fall[fast] * before[fast]) / (before[fast] + after[fast])
    over_even = 0.5 * np.abs(rise[fast] - fall[fast])
    # Steps of the sensor may be equal by its rounding.
    rounding = 0.5 * axis.resolution[field]
    ratio = (float(np.median(over_even)) + rounding) / max(float(np.median(over_stamps)), 1e-300)
    mostly = float(np.mean(over_even < over_stamps))
    if ratio > _SMOOTHER or mostly < max(_MOSTLY, 0.5 + _ERRORS * 0.5 / fast.sum() ** 0.5):
        return []
    scatter = jitter * period
    name = axis.name(field)
    return [
        fault(
            "wrong_stamps",
            name,
            f"the stamps of {name} scatter by {1e3 * scatter:.3g} ms around the {1e3 * period:.4g} ms period, but the"
            f" motion does not ({1.0 / ratio:.2g} times smoother over even times): these are times of reception, not of"
            " the samples",
            "stamp where the sensor is read, or import with even stamps (`time: {period: ...}` in the mapping)",
            evidence={"jitter": scatter, "smoother": 1.0 / ratio, "share": mostly},
            spoils=("delays",),
        )
    ]
