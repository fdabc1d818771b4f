"""One error of one model in one view on known data: the number behind a tile, a row of a table and a line of a figure.

Names, texts and trends are functions of it, so that page, report and command line cannot say different things. It is
read from the errors of a ladder's step, which are those of the JSON documents.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

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
        force = (
            before[DRIVE_FORCE].trend(after[DRIVE_FORCE]) if DRIVE_FORCE in before and DRIVE_FORCE in after else SAME
        )
        runs = [before[name].trend(one) for name, one in after.items() if one.view == FREE_RUN and name in before]
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
