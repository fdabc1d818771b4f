"""Errors of models: the number behind a tile, a row of a table and a line of a figure.

Names, texts and trends are functions of it, so that page, report and command line cannot say different things. It is
read from the errors of a ladder's step, which are those of the JSON documents.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from idloop.arrays import Array
from idloop.p_values import p_text
from idloop.reporting.terms import DATA_USE, effect_words
from idloop.validation.where import DRIVE_FORCE, NOISE_ALONE
from idloop.validation.words import fit_text, force_text

if TYPE_CHECKING:
    from idloop.diagnosis import Ladder, Step
    from idloop.validation import Comparison

TRAIN, VALIDATION = "train", "validation"
FREE_RUN, FORCE = "free_run", "force"
NOTABLE_NOISE = 0.3  # of an error, from which on the part of sensor noise is worth a word
BETTER, WORSE, SAME = "better", "worse", "same"
_DECADES = 5.0  # ratio of the largest to the smallest error from which on decades are read better


@dataclass(frozen=True)
class Score:
    """An error."""

    view: str  # one of `free_run`, `force`
    quantity: str  # name of the output, or "drive force"
    # FIT of the free run [%], or error of the force as a part of the commanded force; None where not known
    value: float | None
    data: str = ""  # what it is of: "unseen data", "run2 (unseen)"; empty where that is said beside it
    # Version of the model, see `idloop.reporting.workbench.state.model_version`; empty where there is only one
    model: str = ""
    # FIT of the prediction of the same output so many samples ahead [%]; None where not known
    predicted: float | None = None
    steps: int = 0
    noise: float | None = None  # error of the force that the sensors' noise alone makes; None where not known

    @property
    def name(self) -> str:
        """What it is: "FIT motor.position"."""
        return f"FIT {self.quantity}" if self.view == FREE_RUN else f"error of the {self.quantity}"

    @property
    def text(self) -> str:
        """The number with its unit, or words where it says nothing."""
        return fit_text(self.value, 3, " %") if self.view == FREE_RUN else force_text(self.value, 3, " %")

    @property
    def beside(self) -> str:
        """The same output predicted: "99.9 % 10 steps ahead"; of a force what noise makes of it; empty if not known."""
        if self.predicted is not None:
            return f"{fit_text(self.predicted, 3, ' %')} {self.steps} steps ahead"
        if self.noise is None or self.value is None or self.noise < NOTABLE_NOISE * self.value:
            return ""
        return NOISE_ALONE if self.noise >= self.value else f"{force_text(self.noise, 3, ' %')} from sensor noise alone"

    @property
    def cell(self) -> str:
        """The number for a column whose head has the unit."""
        return fit_text(self.value) if self.view == FREE_RUN else force_text(self.value)

    @property
    def share(self) -> float:
        """Length of a bar, 0 to 1."""
        known = self.value if self.value is not None and math.isfinite(self.value) else 0.0
        return min(max(0.01 * known if self.view == FREE_RUN else known, 0.0), 1.0)

    @property
    def about(self) -> str:
        """How it is to be read, as a sentence."""
        of = f" on {self.data}" if self.data else ""
        if self.view == FREE_RUN:
            return f"FIT of the free run{of}: 100 % is perfect, 0 % no better than a constant."
        return f"Applied minus needed drive force{of}, relative to the commanded force (rms)."

    def trend(self, after: Score) -> str:
        """Whether another one is better, judged by what is read."""
        if self.value is None or after.value is None or self.text == after.text:
            return SAME
        return BETTER if (after.value > self.value) == (self.view == FREE_RUN) else WORSE

    def to_dict(self) -> dict[str, Any]:
        """What a page shows of it."""
        names = ("view", "quantity", "value", "data", "name", "text", "about", "beside")
        own = {name: getattr(self, name) for name in names}
        return {**own, "share": self.share}


def scores_of(errors: Mapping[str, Any], data: str = "", model: str = "") -> dict[str, Score]:
    """Scores of the errors that a step of a ladder has of some data, by output and "drive force".

    Returns: the outputs whose FIT is known, then the drive force where it is.
    """
    ahead, steps = errors.get("ahead", {}), int(errors.get("steps", 0))
    found = {
        name: Score(FREE_RUN, name, _finite(fit), data, model, _finite(ahead.get(name)), steps)
        for name, fit in errors.get("fit", {}).items()
    }
    force, noise = _finite(errors.get("force")), _finite(errors.get("force_noise"))
    if force is not None:
        found[DRIVE_FORCE] = Score(FORCE, DRIVE_FORCE, force, data, model, noise=noise)
    return found


def disagreements(ladder: Ladder) -> list[str]:
    """Steps after which the drive force is explained better and a free run is worse, or the other way about."""
    kind, found = judging(ladder), []
    scores = [step_scores(step, kind) for step in ladder.steps]
    for step, before, after in zip(ladder.steps[1:], scores, scores[1:], strict=False):
        trends = {name: before[name].trend(one) for name, one in after.items() if name in before}
        force, runs = trends.pop(DRIVE_FORCE, SAME), list(trends.values())
        name = "" if step.added is None else step.added.name
        if force == BETTER and runs and all(one == WORSE for one in runs):
            found.append(
                f"{name} makes the error of the drive force smaller and the free run worse: in a free run every force"
                " that is still missing adds up, however small"
            )
        elif force == WORSE and runs and all(one == BETTER for one in runs):
            found.append(f"{name} makes the free run better and the error of the drive force larger")
    return found


def unknown_force(steps: Sequence[Step], kind: str) -> str:
    """Why the error of the drive force is not that of every step; empty where it is, or that of none."""
    known = [DRIVE_FORCE in step_scores(step, kind) for step in steps]
    if all(known) or not any(known):
        return ""
    if known[-1]:
        return "–: too much of the error of the drive force is sensor noise."
    added = steps[len(known) - known[::-1].index(True)].added
    what = "" if added is None else f" with {effect_words(added.name)}"
    return f"–: for a model{what}, the measurements do not determine the drive force."


def comparison_errors(comparison: Comparison) -> dict[str, Any]:
    """Errors of a comparison as `idloop.diagnosis.model_errors` has those of a step, and those of its predictions."""
    force = comparison.force
    return {
        "fit": comparison.fit,
        "ahead": comparison.fit_ahead,
        "steps": comparison.steps,
        "force": force.relative if force is not None and force.trusted else None,
        "force_noise": None if force is None else force.noise,
    }


def judging(ladder: Ladder) -> str:
    """Data that judge a ladder: ``validation`` where any were unseen, else ``train``."""
    return VALIDATION if any(step.validation for step in ladder.steps) else TRAIN


def step_scores(step: Step, kind: str) -> dict[str, Score]:
    """As `scores_of`, of a step on ``train`` or ``validation`` data."""
    return scores_of(getattr(step, kind), f"{DATA_USE[kind]} data")


def _finite(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else float(value)


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
