"""Values that a recording lacks: how many, where, and what stands in their place."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from idloop.records.finding import Finding

Floats = NDArray[np.float64]
Stamps = NDArray[np.int64]


def missing_values(name: str, stamp_ns: Stamps, value: Floats, where: str, *, command: bool) -> list[Finding]:
    """What is to be said of the NaN in one signal: nothing, or one finding.

    Parameters
    ----------
    name : str
        Of the signal, for the reader.
    stamp_ns : ndarray of int64, shape (n,)
        Times are told from the first of them on.
    value : ndarray, shape (n,)
        In any unit; NaN where it is missing.
    where : str
        Topic or column.
    command : bool
        A command is held over its holes, which no measurement is: then a fit may be wrong because of them.
    """
    lost = np.flatnonzero(np.isnan(value))
    if not lost.size:
        return []
    first, last = (float(stamp_ns[k] - stamp_ns[0]) * 1e-9 for k in (lost[0], lost[-1]))
    stretches = 1 + int(np.count_nonzero(np.diff(lost) > 1))
    place = f"at {first:.6g} s" if lost.size == 1 else f"from {first:.6g} to {last:.6g} s"
    if stretches > 1:
        place = f"in {stretches} places {place}"
    text = f"{name}: {lost.size} of {value.size} values are empty (NaN), {place}"
    # Before its first value a command is unknown, not held.
    if command and lost[-1] >= lost.size:
        text += "; the last command before is taken to hold there: mend the log if the drive got another"
    return [Finding("not_measured", text, int(lost.size), where, "warning" if command else "note")]
