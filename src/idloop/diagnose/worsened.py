"""Steps of a ladder after which the model runs worse on its own.

By prediction a step is judged by errors one step ahead, where what the model gets wrong passes for a disturbance. An
effect that stands in for one that the catalogue does not have may lessen those and spoil the motion all the same.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

# The free run drifts by chance on an axis that integrates: less than this is not told, nor an error of less than that
# part of the motion, nor what becomes of a run that has missed so much of it before.
_FACTOR, _LEAST, _LOST = 1.25, 0.01, 0.5
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
    output : str
        The one that it made worst.
    before, after : float
        Error of its free run as a part of its standard deviation.
    """

    name: str
    unseen: bool
    output: str
    before: float
    after: float

    @property
    def text(self) -> str:
        """In words."""
        data = "data that no fit saw" if self.unseen else "the fitted data"
        return (
            f"{self.name} makes the free run of {self.output} on {data} worse, an error of {100.0 * self.after:.3g} %"
            f" after {100.0 * self.before:.3g} % of the motion: the errors one step ahead ask for it, the motion does"
            " not. Something else may be missing there; take it back, or look where the model fails"
        )

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {
            "effect": self.name,
            "unseen": self.unseen,
            "output": self.output,
            "before": self.before,
            "after": self.after,
        }


def worsened(names: Sequence[str], errors: Sequence[Mapping[str, Any]], *, unseen: bool) -> list[Worsened]:
    """Steps after which an output's free run is worse by a quarter or more, and neither error below falls.

    The force's error, and that of the run when it is started anew at every fifth of a record: on an axis that
    integrates a disturbance carries a long run away, whatever the model.

    Parameters
    ----------
    names : sequence of str
        Of what each step added; the first one's does not count.
    errors : sequence of mapping
        Of each step, as `idloop.diagnose.errors.model_errors` tells them.
    unseen : bool
        Whether no fit saw the records.

    Returns
    -------
    list of Worsened
        In the order of the steps.
    """
    found = []
    for name, (before, after) in zip(names[1:], pairwise(errors), strict=True):
        errors_before, errors_after = before.get("nrmse", {}), after.get("nrmse", {})
        factors = {
            output: error / max(errors_before[output], 1e-300)
            for output, error in errors_after.items()
            if error > _LEAST and errors_before.get(output, 1.0) < _LOST
        }
        worst = max(factors, key=lambda output: factors[output] if math.isfinite(factors[output]) else 0.0, default="")
        if (
            worst
            and factors[worst] > _FACTOR
            and not _force_falls(before, after)
            and not _drifted(before, after, worst)
        ):
            found.append(Worsened(name, unseen, worst, errors_before[worst], errors_after[worst]))
    return found


def _drifted(before: Mapping[str, Any], after: Mapping[str, Any], output: str) -> bool:
    """Whether the run is no worse where it is started anew time and again: then what carried it away was chance."""
    one, two = before.get("anew", {}).get(output), after.get("anew", {}).get(output)
    return one is not None and two is not None and two <= one


def _force_falls(before: Mapping[str, Any], after: Mapping[str, Any]) -> bool:
    one, two = before.get("force"), after.get("force")
    return one is not None and two is not None and two < _FALLS * one
