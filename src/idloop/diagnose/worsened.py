"""Steps of a ladder after which the model runs worse on its own.

By prediction a step is judged by errors one step ahead, where what the model gets wrong passes for a disturbance. An
effect that stands in for one that the catalogue does not have may lessen those and spoil the motion all the same.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from idloop.diagnose.ladder import Ladder

# The free run drifts by chance on an axis that integrates: less than this is not told.
_FACTOR = 1.25
# An error of the force that falls by this part speaks for the step whatever the free run does.
_FALLS = 0.98


@dataclass(frozen=True)
class Worsened:
    """A step after which the free run is worse.

    Attributes
    ----------
    name : str
        Effect and site that were added.
    unseen : bool
        Judged on validation records; else on those of the fit.
    before, after : float
        Error of the free run as a part of the outputs' standard deviation, root mean square over the outputs.
    """

    name: str
    unseen: bool
    before: float
    after: float

    @property
    def text(self) -> str:
        """In words."""
        data = "data that no fit saw" if self.unseen else "the fitted data"
        return (
            f"{self.name} makes the free run on {data} worse, an error of {100.0 * self.after:.3g} % after"
            f" {100.0 * self.before:.3g} % of the motion: the errors one step ahead ask for it, the motion does not."
            " Something else may be missing there; take it back, or look where the model fails"
        )

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {"effect": self.name, "unseen": self.unseen, "before": self.before, "after": self.after}


def worsened(ladder: Ladder) -> list[Worsened]:
    """Steps after which the free run is worse by a quarter or more, and the error of the force does not fall.

    Parameters
    ----------
    ladder : Ladder

    Returns
    -------
    list of Worsened
        In the order of the steps; judged on validation records where there are any.
    """
    unseen = bool(ladder.steps[0].validation)
    found = []
    for before, step in zip(ladder.steps, ladder.steps[1:], strict=False):
        first, second = (one.validation if unseen else one.train for one in (before, step))
        errors = _free_run(first), _free_run(second)
        if step.added is not None and errors[1] > _FACTOR * errors[0] and not _force_falls(first, second):
            found.append(Worsened(step.added.name, unseen, *errors))
    return found


def _free_run(measures: Mapping[str, Any]) -> float:
    values = list(measures.get("nrmse", {}).values())
    return float(np.sqrt(np.mean(np.square(values)))) if values else float("nan")


def _force_falls(before: Mapping[str, Any], after: Mapping[str, Any]) -> bool:
    one, two = before.get("force"), after.get("force")
    return one is not None and two is not None and two < _FALLS * one
