"""Records cut at long gaps of the measurements, so that the unknown motion there is not simulated."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from idloop.errors import InputError
from idloop.records.finding import Finding
from idloop.records.record import Record

# Longest gap inside a record, in seconds and in sample times, whichever is longer; the command is known there.
LONGEST_GAP = 1.0
LONGEST_GAP_SAMPLES = 50
# Fewest measurements of a part.
FEWEST = 10
# Gaps that are listed; of the others the number is given.
NAMED = 3
LEFT_OUT = "part_left_out"
# Behind the name of a record, the number of its part.
_NUMBER = re.compile(r"\(\d+\)$")


def cut_at_gaps(record: Record) -> list[Record]:
    """Cut a record at its long gaps, into parts with the time axis of the whole record.

    Parts of fewer than ten measurements are left out. Where it has no long gap, or no part is long enough, the record
    itself is returned.
    """
    steps = np.diff(record.time)
    edges = np.flatnonzero(steps > max(LONGEST_GAP, LONGEST_GAP_SAMPLES * record.sample_time)) if steps.size else steps
    starts = np.concatenate([[0], edges + 1])
    ends = np.concatenate([edges, [record.time.size - 1]])
    long_enough = ends - starts + 1 >= FEWEST
    if not edges.size or not long_enough.any():
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


def usable_parts(records: Sequence[Record], check: Callable[[Record], Record]) -> list[Record]:
    """Check the parts of records that `cut_at_gaps` gives; those that fail are left out, if others of the record pass.

    `check`: returns the record, with findings, or raises `InputError`.
    A finding of the first part that is kept names those that are not, and why.
    Raises InputError: no part of a record passes: that of its first one.
    """
    found: list[Record] = []
    for parts in _by_record(records):
        kept, refused = [], []
        for part in parts:
            try:
                kept.append(check(part))
            except InputError as error:
                refused.append(error)
        if not kept:
            raise refused[0]
        if refused:
            # What was found of the whole record stands at its first part.
            carried = () if kept[0].name == parts[0].name else parts[0].findings
            found.append(replace(kept[0], findings=(*carried, *kept[0].findings, _left_out(kept[0], parts, refused))))
            kept = kept[1:]
        found += kept
    return found


def _by_record(records: Sequence[Record]) -> list[list[Record]]:
    """Records in groups that are parts of one."""
    groups: list[list[Record]] = []
    for one in records:
        last = groups[-1][-1] if groups else None
        same = last is not None and (last.start_ns, _whole(last)) == (one.start_ns, _whole(one))
        if last is not None and same and one.time.size and last.time.size and one.time[0] > last.time[-1]:
            groups[-1].append(one)
        else:
            groups.append([one])
    return groups


def _whole(part: Record) -> str:
    return _NUMBER.sub("", part.name)


def _left_out(first: Record, parts: Sequence[Record], refused: Sequence[InputError]) -> Finding:
    which = "one is" if len(refused) == 1 else f"{len(refused)} are"
    why = "; ".join(map(str, refused[:NAMED])) + (f"; and {len(refused) - NAMED} more" if len(refused) > NAMED else "")
    text = f"of {len(parts)} parts between gaps {which} left out, which no fit can use: {why}"
    return Finding(LEFT_OUT, text, len(refused), first.name, "warning")
