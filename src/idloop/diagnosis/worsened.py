"""Steps of a ladder after which the model runs worse on its own.

By prediction a step is judged by errors one step ahead, where what the model gets wrong passes for a disturbance. An
effect that stands in for one that the catalogue does not have may lessen those and spoil the motion all the same.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from typing import Any


@dataclass(frozen=True)
class Worsened:
    """A step after which the free run is worse."""

    name: str  # effect and site that were added
    unseen: bool  # judged on validation records; else on those of the fit
    output: str  # the one that it made worst
    before: float  # error of its free run as a part of its standard deviation
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
        own = asdict(self)
        return {"effect": own.pop("name"), **own}


def worsened(names: Sequence[str], errors: Sequence[Mapping[str, Any]], *, unseen: bool) -> list[Worsened]:
    """Steps after which an output's free run is worse by a quarter or more, and neither error below falls.

    The force's error, and that of the run when it is started anew at every fifth of a record: on an axis that
    integrates a disturbance carries a long run away, whatever the model. `names` are of what each step added, the first
    one's does not count; `errors` are those of `idloop.diagnosis.model_errors.model_errors`.
    """
    found = []
    for name, (before, after) in zip(names[1:], pairwise(errors), strict=True):
        was, now = before.get("nrmse", {}), after.get("nrmse", {})
        # The free run drifts by chance on an axis that integrates: an error of less than a hundredth of the motion is
        # not told, nor what becomes of a run that has missed half of it before.
        factors = {
            output: error / max(was[output], 1e-300)
            for output, error in now.items()
            if error > 0.01 and was.get(output, 1.0) < 0.5
        }
        worst = max(factors, key=lambda output: factors[output] if math.isfinite(factors[output]) else 0.0, default="")
        # An error of the force that falls by 2 % speaks for the step whatever the free run does. Where the run is no
        # worse once it is started anew time and again, what carried it away was chance.
        falls = _known(after.get("force")) < 0.98 * _known(before.get("force"))
        drifted = _known(after.get("anew", {}).get(worst)) <= _known(before.get("anew", {}).get(worst))
        if worst and factors[worst] > 1.25 and not falls and not drifted:
            found.append(Worsened(name, unseen, worst, was[worst], now[worst]))
    return found


def _known(value: float | None) -> float:
    """NaN, which is neither less nor more than anything, where there is none."""
    return math.nan if value is None else value
