"""Alarms of wear: Page's test of `idloop.monitoring` on the recordings of each joint.

The blocks of the monitor are recordings here: their log-likelihood ratio of a growth by a fifth against none is added
up. The first recordings of a joint are its reference. The variance of a recording is that of its kind, known from many
joints, so that the rate of false alarms is averaged over the uncertain mean of the reference alone.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq

from idloop.arrays import Array
from idloop.errors import InputError
from idloop.fleet.statistics import Components, Finding, finding_of
from idloop.monitoring import choose_watches
from idloop.monitoring.run_length import FEWEST_BLOCKS, run_length
from idloop.monitoring.watch import USUAL_GROWTH
from idloop.physics import Model

FALSE_ALARMS = 10_000  # recordings of a joint between two false alarms
REFERENCE = 7  # recordings of a joint that count as healthy
_LEAST, _MOST = 3.0, 3.0  # least threshold; highest one over the logarithm of the recordings
_NODES = 41


def watched(model: Model) -> tuple[str, ...]:
    """Parameters that can wear: those that `idloop monitor` watches where none is named."""
    try:
        return tuple(one.parameter for one in choose_watches(model, ()))
    except InputError:
        return ()


def wear_alarms(parts: Components, recordings: float = FALSE_ALARMS) -> list[Finding] | None:
    """Alarms of one parameter: the first one of each joint, with the growth since its onset.

    `recordings`: between two false alarms of a joint. Returns None where recordings scatter too much for such a
    promise. The p-value is the rate of false alarms.
    """
    growth = USUAL_GROWTH * abs(parts.mean)
    variance = float(np.nanmedian(parts.total))
    if not growth > 0.0 or not variance > 0.0:
        return None
    threshold = _threshold(recordings, 0.5 * growth**2 / variance)
    if threshold is None:
        return None
    found = []
    for name, row, own in zip(parts.series.names, parts.left, parts.total, strict=True):
        seen = np.flatnonzero(np.isfinite(row))
        alarm = _first_alarm(row[seen], own[seen], growth, threshold)
        if alarm is None:
            continue
        onset, size, error = alarm
        day = float(parts.series.days[seen[onset]])
        found.append(finding_of(parts.series, "alarm", day, size, error, parts.freedom, name, 1.0 / recordings))
    return found


def _threshold(recordings: float, ratio: float) -> float | None:
    """Threshold with one false alarm in so many recordings; None where it would be too high to be of use.

    `ratio`: half the squared growth over the variance of a recording.
    """
    nodes, weights = np.polynomial.hermite_e.hermegauss(_NODES)
    drift = -ratio * (1.0 - 2.0 * nodes / np.sqrt(2.0 * ratio * REFERENCE))

    def excess(threshold: float) -> float:
        rate = weights @ (1.0 / run_length(threshold, drift, 2.0 * ratio)) / np.sum(weights)
        return float(np.log(rate * recordings))

    most = _MOST * np.log(recordings)
    if excess(most) > 0.0:
        return None
    return _LEAST if excess(_LEAST) <= 0.0 else float(brentq(excess, _LEAST, most))


def _first_alarm(y: Array, own: Array, growth: float, threshold: float) -> tuple[int, float, float] | None:
    """Onset of the first alarm, the growth since then, and its standard error; None without one."""
    if len(y) <= REFERENCE:
        return None
    level = float(np.mean(y[:REFERENCE]))
    total, onset = 0.0, REFERENCE
    for place in range(REFERENCE, len(y)):
        ratio = growth * (y[place] - level - 0.5 * growth) / own[place]
        # As in the monitor: a single recording raises no alarm.
        total += min(ratio, threshold / FEWEST_BLOCKS)
        if total <= 0.0:
            total, onset = 0.0, place + 1
        elif total > threshold:
            since = slice(onset, place + 1)
            error = np.sqrt(np.mean(own[since]) * (1.0 / (place + 1 - onset) + 1.0 / REFERENCE))
            return onset, float(np.mean(y[since]) - level), float(error)
    return None
