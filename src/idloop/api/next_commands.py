"""What to run after a log was started: from its records to a named effect."""

from __future__ import annotations

import itertools
import re
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
_NUMBERED = re.compile(r"(?P<name>.*[^\d])(?P<number>0|[1-9]\d*)")
_MOST_NAMED = 6  # words that differ by a number only, of which each is written
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
        words = shlex.split(line)
        purpose = _PURPOSE.get(words[1], "")
        if purpose != before:
            yield f"  # {purpose}"
        yield f"  {' '.join(_in_braces(words))}"
        before = purpose


def _in_braces(words: Sequence[str]) -> Iterator[str]:
    """Yield words of a command, of which many that differ by a number are one: ``run{{1..44},{46..82}}``."""
    matches = [_NUMBERED.fullmatch(word) for word in words]
    same = itertools.groupby(
        zip(words, matches, strict=True), key=lambda pair: pair[1]["name"] if pair[1] is not None else None
    )
    for name, pairs in same:
        group = list(pairs)
        numbers = [int(match["number"]) for _, match in group if match is not None]
        if name is None or len(group) <= _MOST_NAMED or numbers != sorted(set(numbers)):
            yield from (shlex.quote(word) for word, _ in group)
            continue
        # Numbers that follow each other lie as far from their places.
        runs = itertools.groupby(enumerate(numbers), key=lambda pair: pair[1] - pair[0])
        ends = [[number for _, number in run] for _, run in runs]
        said = [f"{{{run[0]}..{run[-1]}}}" if len(run) > 1 else f"{run[0]}" for run in ends]
        braces = f"{{{','.join(said)}}}" if len(said) > 1 else said[0]
        yield f"{shlex.quote(name)}{braces}"


def commands(lines: Sequence[Sequence[str]]) -> list[str]:
    """Return lines of words as commands of a shell."""
    return [f"{program()} {shlex.join(line)}" for line in lines]


def _commands(inspection: Inspection) -> Array:
    """Values of the command of a record; of several driven joints those of the first."""
    values = next((axis.command for axis in inspection.axes if axis.command.size), np.zeros(0))
    return np.asarray(values[np.isfinite(values)])
