"""Records cut at long gaps of the measurements, so that the unknown motion there is not simulated."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from idloop.records.finding import Finding
from idloop.records.record import Record

# Longest gap inside a record, in seconds and in sample times, whichever is longer; the command is known there.
LONGEST_GAP = 1.0
LONGEST_GAP_SAMPLES = 50
# Fewest measurements of a part.
FEWEST = 10
# Gaps that are listed; of the others the number is given.
NAMED = 3


def cut_at_gaps(record: Record) -> list[Record]:
    """Cut a record at its long gaps.

    Returns
    -------
    list of Record
        The parts in order, with the time axis of the whole record; parts of fewer than ten measurements are left out.
        The record itself where it has no long gap, or no part is long enough.
    """
    steps = np.diff(record.time)
    if not steps.size:
        return [record]
    longest = max(LONGEST_GAP, LONGEST_GAP_SAMPLES * record.sample_time)
    edges = np.flatnonzero(steps > longest)
    if not edges.size:
        return [record]
    starts = np.concatenate([[0], edges + 1])
    ends = np.concatenate([edges, [record.time.size - 1]])
    long_enough = ends - starts + 1 >= FEWEST
    if not long_enough.any():
        return [record]
    finding = _finding(record, edges, steps, int(long_enough.sum()))
    parts = [
        record.cut(float(record.time[start]), float(record.time[end]))
        for start, end in zip(starts[long_enough], ends[long_enough], strict=True)
    ]
    # The first part carries the findings.
    parts[0] = replace(parts[0], findings=(*record.findings, finding))
    rest = [replace(part, name=f"{record.name}({number})", findings=()) for number, part in enumerate(parts[1:], 2)]
    return [parts[0], *rest]


def _finding(record: Record, edges: np.ndarray, steps: np.ndarray, parts: int) -> Finding:
    places = [f"{steps[k]:.4g} s after {record.time[k]:.6g} s" for k in edges[:NAMED]]
    more = f" and {edges.size - NAMED} more" if edges.size > NAMED else ""
    used = f"{parts} of {edges.size + 1} parts are used"
    text = f"nothing was measured for {', '.join(places)}{more}: the record is cut there, {used}"
    return Finding("gap", text, int(edges.size), record.name, "warning")
