"""Stamps that are not the times of the samples: the motion is smoother over the number of the sample than over them.

A sampler takes its samples at even times; the network, the operating system or the recorder delays the messages, and
each by another time. Where the axis moves, a wrong stamp shows as a jump of its speed.
"""

from __future__ import annotations

import numpy as np

from idloop.records.finding import Finding
from idloop.records.inspection.axis import Axis
from idloop.records.inspection.faults.fault import fault
from idloop.records.inspection.response import regress

# Scatter of the stamps that is worth a look, and intervals that count as lost samples, in periods.
_JITTER, _LOST = 0.03, 1.6
# Share of the bends of uneven stamps that the motion shows: 1 for times of samples, 0 for others. Standard errors, the
# largest of them, and samples on each side that give the speed.
_SHOWS, _ERRORS, _CERTAIN, _BESIDE = 0.5, 5.0, 0.1, 4
# Share of the largest bends, at jumps and wraps.
_ODD = 0.01
_FEWEST = 100


def check(axis: Axis) -> list[Finding]:
    """Compare the bends of the motion, over the number of the sample, with those that its stamps ask for.

    At constant speed a sample that was taken late lies further on: ``x[k+1] - 2 x[k] + x[k-1] = v (step after - step
    before)``.
    """
    field = "position" if axis.place is not None else "velocity"
    value = axis.place if axis.place is not None else axis.velocity
    if value is None:
        return []
    known = np.isfinite(value)
    time, value = axis.time[known], value[known]
    if time.size < _FEWEST:
        return []
    near = slice(_BESIDE - 1, 1 - _BESIDE)
    before, after = np.diff(time)[:-1][near], np.diff(time)[1:][near]
    period = axis.period
    whole = (np.maximum(before, after) < _LOST * period) & (np.minimum(before, after) > 0.0)
    # Independent errors of three stamps make the difference of two intervals.
    jitter = float(np.sqrt(np.mean(((before - after)[whole] / period) ** 2) / 6.0)) if whole.any() else 0.0
    if whole.sum() < _FEWEST or jitter < _JITTER:
        return []
    bend = np.diff(value, 2)[near]
    speed = (value[2 * _BESIDE :] - value[: -2 * _BESIDE]) / (2.0 * _BESIDE * period)
    whole &= np.abs(bend) <= np.quantile(np.abs(bend[whole]), 1.0 - _ODD)
    asked = (speed * (after - before))[whole]
    if not np.any(asked):
        return []
    (shown,), (error,), _ = regress(bend[whole], asked[:, None])
    if error > _CERTAIN or shown + _ERRORS * error > _SHOWS:
        return []
    scatter, name = jitter * period, axis.name(field)
    return [
        fault(
            "wrong_stamps",
            name,
            f"the stamps of {name} scatter by {1e3 * scatter:.3g} ms around the {1e3 * period:.4g} ms period, but its"
            f" motion does not ({shown:.2f} ± {error:.1g} of the scatter shows in it): they are times of reception, not"
            " of the samples",
            "stamp where the sensor is read, or import with even stamps (`time: {period: ...}` in the mapping)",
            evidence={"jitter": scatter, "shown": float(shown), "error": float(error)},
            spoils=("delays",),
        )
    ]
