"""Errors of a ladder step by step, as the printed figure, the report and the workbench show them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from idloop.arrays import Array
from idloop.p_values import p_text
from idloop.reporting.scores import TRAIN, VALIDATION
from idloop.reporting.terms import DATA_USE, effect_words
from idloop.validation.where import DRIVE_FORCE

if TYPE_CHECKING:
    from idloop.diagnosis import Ladder, Step


# From this ratio of the largest to the smallest error on, decades are read better.
_DECADES = 5.0


@dataclass(frozen=True)
class ErrorLine:
    """Error of one quantity at every step."""

    quantity: str  # name of the output, or "drive force"
    kind: str  # one of `train`, `validation`
    use: str  # what the data served for, in words; empty where there are no others
    colour: int  # number of the quantity; train and validation of one have the same
    error: Array  # shape (steps,): NaN where not known

    @property
    def label(self) -> str:
        """Entry of a legend."""
        return f"{self.quantity}, {self.use} data" if self.use else self.quantity


def error_lines(ladder: Ladder) -> list[ErrorLine]:
    """NRMSE of the free run of every output at every step; unseen data first, no line for what is known at one only."""
    names = dict.fromkeys(name for step in ladder.steps for name in step.train.get("nrmse", {}))
    return _lines(ladder, names, lambda part, name: part.get("nrmse", {}).get(name))


def force_lines(ladder: Ladder) -> list[ErrorLine]:
    """Relative error of the drive force [%] at every step; as `error_lines`."""
    return _lines(ladder, [DRIVE_FORCE], lambda part, name: part.get("force"), 100.0)


def in_decades(*errors: Array) -> bool:
    """Whether errors span so much that a logarithmic axis is read better."""
    values = np.concatenate(errors) if errors else np.zeros(0)
    values = values[np.isfinite(values) & (values > 0.0)]
    return bool(len(values)) and float(np.max(values)) > _DECADES * float(np.min(values))


def step_title(step: Step) -> str:
    """What a step added, in words."""
    return "start" if step.added is None else f"+ {effect_words(step.added.name)}"


def step_evidence(step: Step) -> str:
    """Who or what asked for a step: a p-value, or the user; empty at the start."""
    if step.added is None:
        return ""
    return "chosen by the user" if step.chosen_by == "user" else p_text(step.p_value)


def _lines(
    ladder: Ladder, quantities: Iterable[str], read: Callable[[Mapping[str, Any], str], Any], scale: float = 1.0
) -> list[ErrorLine]:
    unseen = any(step.validation for step in ladder.steps)
    found = []
    for kind in (VALIDATION, TRAIN):
        for colour, name in enumerate(quantities):
            values = [read(getattr(step, kind), name) for step in ladder.steps]
            error = scale * np.array([np.nan if value is None else float(value) for value in values])
            # One step of several says nothing of what an effect did.
            if np.count_nonzero(np.isfinite(error)) >= min(2, len(error)):
                found.append(ErrorLine(name, kind, DATA_USE[kind] if unseen else "", colour, error))
    return found
