"""A closed loop without and with compensation in words: what is cancelled, and the tracking errors."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from idloop.reporting.text.blocks import Block, Table, number

if TYPE_CHECKING:
    from idloop.arrays import Array
    from idloop.control.tracking import Tracking

_STANDS = 0.01  # of the motion of the reference: an axis that moves less is held


def ratio(after: float, before: float) -> float:
    """One error over another; NaN where there was none before."""
    return after / before if before > 0.0 else math.nan


def command_sizes(command: Array) -> Mapping[str, float]:
    """Root mean square and largest size of a command, and the root mean square of its change per sample."""
    import numpy as np

    return {
        "rms": float(np.sqrt(np.mean(command**2))),
        "largest": float(np.max(np.abs(command))),
        "step_rms": float(np.sqrt(np.mean(np.diff(command) ** 2))),
    }


def stands(run: Tracking, output: str) -> bool:
    """Whether an axis that is to move stays where it is."""
    import numpy as np

    column = run.names.index(output)
    moved, wanted = (float(np.ptp(one[:, column])) for one in (run.output, run.wanted))
    return moved < _STANDS * wanted


def tracking_blocks(
    runs: Sequence[Tracking | None], plan: Any, reference: str, followed: str, settle: float, model: str, unit: str
) -> Iterator[Block]:
    """Yield what is cancelled and how, the tracking errors, and the size of the command [`unit`].

    `runs`: without compensation, with it, and without the effects. `plan`: what the controller cancels and what it
    leaves. `reference`: what is followed, in words; `followed`: output that follows it. `settle`: seconds at the start
    that the errors leave out. `model`: name of the compensating model.
    """
    from idloop.control.compensation import WORDS

    without, compensated, aim = runs
    assert without is not None  # noqa: S101 - both loops were run
    assert compensated is not None  # noqa: S101
    cancelled = [(one.active.name, WORDS[one.how]) for one in plan.cancelled]
    cancelled += [(name, f"not cancelled: {reason}") for name, reason in plan.left.items()]
    nothing = f"model {model} has no effects: nothing is cancelled"
    yield Table.of(("effect", "cancelled by"), cancelled) if cancelled else nothing
    yield ""
    yield f"reference: {reference}"
    yield ""
    header = ["tracking error", "unit", "rms without", "rms with", "ratio", "largest without", "largest with"]
    table = []
    units = dict(zip(without.names, without.units, strict=True))
    for name in without.followed:
        before, after = without.error_of(name, settle), compensated.error_of(name, settle)
        row = [name, units[name], *map(number, (before.rms, after.rms)), number(ratio(after.rms, before.rms), 3)]
        row += map(number, (before.largest, after.largest))
        if aim is not None:
            row.append(number(aim.error_of(name, settle).rms))
        table.append(row)
    if aim is not None:
        header.append("rms without the effects")
    yield Table.of(header, table)
    for loop, run in (("without", without), ("with", compensated)):
        if stands(run, followed):
            yield f"warning: {loop} compensation the axis does not move: the commands do not overcome what holds it"
    sizes = [command_sizes(run.command) for run in (without, compensated)]
    words = {"largest": "largest", "step_rms": "from sample to sample (rms)"}
    texts = (f"{text} {number(sizes[0][key])} without, {number(sizes[1][key])} with" for key, text in words.items())
    yield ""
    yield f"command [{unit}]: {'; '.join(texts)}"
