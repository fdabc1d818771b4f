"""A record that begins with its step: the command is constant, and the axis sets off from rest at the first sample.

Before such a record the axis stood still without a command. The response shows a gain and a time constant, as a record
with the step in it does; that a dead zone or friction takes a part of one level does not show.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from idloop.records.inspection.motion import analyse_motion, white_noise
from idloop.records.record import Record

Floats = NDArray[np.float64]

Beginning = Literal["from rest", "late", "moving", "unseen"]

# Parts of the speed in the end: below the first an axis that begins is at rest, at the second it has set off, at the
# third it is under way.
_REST, _OFF, _UNDER_WAY = 0.4, 0.15, 0.5
# An axis of first order that sets off at once moves at 0.28 of its speed, on average, until it is under way.
_LATE = 0.15
# Samples in which a step counts as that of the first sample.
_AT_ONCE = 3
_FEWEST = 20
# Travel over a window of a position, and speeds, are this many times the steps or the noise.
_ABOVE = 10.0


def beginning(time: Floats, value: Floats, *, velocity: bool) -> tuple[Beginning, float]:
    """How a motion begins, and when it sets off.

    Parameters
    ----------
    time : array, shape (n,)
        Stamps [s].
    value : array, shape (n,)
        Measured position or velocity; NaN where not measured.
    velocity : bool
        Which of the two.

    Returns
    -------
    beginning : {"from rest", "late", "moving", "unseen"}
        From rest at the first sample; at rest for a time first; moving already; or not to be told.
    off : float
        Stamp at which it sets off [s]; NaN where it is not at rest first.
    """
    motion, known = analyse_motion(value, velocity=velocity), np.isfinite(value)
    when, what = time[known], value[known]
    # What turns round under a constant command is driven by something else.
    if when.size < _FEWEST or motion is None or not motion.moves or motion.reversals:
        return "unseen", np.nan
    half, step = when.size // 2, _ABOVE * max(motion.resolution, white_noise(what))
    if velocity:
        end = float(np.median(what[half:]))
        if abs(end) < step:
            return "unseen", np.nan
        over, speed = 0, what / end
        place = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(when))])
    else:
        end = float(what[-1] - what[half]) / float(when[-1] - when[half])
        travel = abs(end) * float(when[-1] - when[0])
        if travel < 4.0 * step:
            return "unseen", np.nan
        over, place = max(int(np.ceil(step / travel * when.size)), 1), (what - what[0]) / end
        speed = (place[over:] - place[:-over]) / (when[over:] - when[:-over])
    if speed[0] > _REST:
        return "moving", np.nan
    under_way = int(np.argmax(speed > _UNDER_WAY))
    still = np.flatnonzero(speed[:under_way] <= _OFF)
    off = int(still[-1]) + over + 1 if still.size else 0
    last = under_way + over
    late = under_way > _AT_ONCE and place[last] < _LATE * (when[last] - when[0])
    return "late" if late else "from rest", float(when[off])


def beginnings(record: Record) -> dict[Beginning, float]:
    """How the measured motions of a record begin, and when the first of each kind sets off [s]."""
    found: dict[Beginning, float] = {}
    for name, column in zip(record.output_names, record.output.T, strict=True):
        field = name.rpartition(".")[2]
        if field in ("position", "velocity"):
            how, off = beginning(record.time, column, velocity=field == "velocity")
            found[how] = min(off, found.get(how, np.inf))
    return found
