"""What to run after a log was started: from its records to a named effect."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from idloop.arrays import Array
from idloop.called_as import program

if TYPE_CHECKING:
    from idloop.records import Inspection

_PURPOSE = {
    "diagnose": "does the model lack a physical effect, and which one?",
    "refine": "add effects one at a time, until nothing is missing, with a report",
    "workbench": "see the same in a browser",
    "inspect": "what the recording holds, in full",
    "fit": "fit the model to these records",
}
_BEYOND = 0.1  # of the range of the commands that a fit sees, by which those that it does not see may go beyond it


def diagnosing(model: Path, bags: Sequence[Path], unseen: Path | None, folder: Path) -> list[str]:
    """Return the commands that name what a model lacks, add it, and show it.

    `bags`: all records.
    `unseen`: the one of them that judges; see `held_out`.
    `folder`: to write to.
    """
    fitted = [str(bag) for bag in bags if bag != unseen]
    judged = ["--validate", str(unseen)] if unseen is not None else []
    return commands([
        ["diagnose", str(model), *map(str, bags)],
        ["refine", str(model), *fitted, *judged, "--output", str(folder)],
        ["workbench", str(model), *fitted, *judged],
    ])  # fmt: skip


def held_out(inspections: Sequence[Inspection]) -> Path | None:
    """Return the record of several that may judge what is fitted to the others; None where they are all needed.

    It is the shortest one whose commands do not go beyond those of the others, which must have several themselves.
    """
    held = {one.path: _commands(one) for one in inspections}
    by_length = sorted(inspections, key=lambda one: max((axis.time.size for axis in one.axes), default=0))
    for one in by_length if len(held) > 1 else ():
        own = held[one.path]
        others = np.concatenate([values for path, values in held.items() if path != one.path])
        if not own.size or not others.size:
            continue
        low, high = float(others.min()), float(others.max())
        margin = _BEYOND * (high - low)
        if high > low and own.min() >= low - margin and own.max() <= high + margin:
            return one.path
    return None


def with_purpose(lines: Sequence[str]) -> Iterator[str]:
    """Yield commands, each below a comment that says what it is for where that is another one than before."""
    before = ""
    for line in lines:
        purpose = _PURPOSE.get(shlex.split(line)[1], "")
        if purpose != before:
            yield f"  # {purpose}"
        yield f"  {line}"
        before = purpose


def commands(lines: Sequence[Sequence[str]]) -> list[str]:
    """Return lines of words as commands of a shell."""
    return [f"{program()} {shlex.join(line)}" for line in lines]


def _commands(inspection: Inspection) -> Array:
    """Values of the command of a record; of several driven joints those of the first."""
    values = next((axis.command for axis in inspection.axes if axis.command.size), np.zeros(0))
    return np.asarray(values[np.isfinite(values)])
