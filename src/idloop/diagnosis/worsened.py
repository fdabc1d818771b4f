"""Steps of a ladder that make the free run worse.

By prediction a step is judged by errors one sample ahead, in which model error counts as a disturbance. An effect that
is confounded with one that is not in the catalogue may reduce these errors and make the free run worse.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from typing import Any

from idloop.validation.words import fit_text


@dataclass(frozen=True)
class Worsened:
    """A step after which the free run is worse."""

    name: str  # effect and site that were added
    unseen: bool  # judged on validation records; else on those of the fit
    output: str  # whose free run became worst
    before: float  # error of its free run as a part of its standard deviation
    after: float

    @property
    def text(self) -> str:
        """Finding for the user."""
        data = "data that no fit saw" if self.unseen else "the fitted data"
        before, after = (fit_text(100.0 * (1.0 - error), 3, " %") for error in (self.before, self.after))
        return (
            f"{self.name} makes the free run of {self.output} on {data} worse, FIT {after} after {before}: it reduces"
            " the prediction errors"
            " only. Something else may be missing; remove it, or check where the model fails"
        )

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        own = asdict(self)
        return {"effect": own.pop("name"), **own}


def worsened(names: Sequence[str], errors: Sequence[Mapping[str, Any]], *, unseen: bool) -> list[Worsened]:
    """Steps after which an output's free run is worse by a quarter or more, and neither of two other errors falls.

    These are the force error, and the error of the run restarted at every fifth of a record: on an integrating axis a
    disturbance makes a long run drift, whatever the model. `names` are what each step added, that of the first does not
    count; `errors` are those of `idloop.diagnosis.model_errors.model_errors`.
    """
    found = []
    for name, (before, after) in zip(names[1:], pairwise(errors), strict=True):
        was, now = before.get("nrmse", {}), after.get("nrmse", {})
        # On an integrating axis the free run drifts by chance: errors below a hundredth of the motion do not count, nor
        # do runs whose error was above half of it before.
        factors = {
            output: error / max(was[output], 1e-300)
            for output, error in now.items()
            if error > 0.01 and was.get(output, 1.0) < 0.5
        }
        worst = max(factors, key=lambda output: factors[output] if math.isfinite(factors[output]) else 0.0, default="")
        # A force error that falls by 2 % supports the step. A run that is no worse when it is restarted has drifted.
        falls = _or_nan(after.get("force")) < 0.98 * _or_nan(before.get("force"))
        drifted = _or_nan(after.get("anew", {}).get(worst)) <= _or_nan(before.get("anew", {}).get(worst))
        if worst and factors[worst] > 1.25 and not falls and not drifted:
            found.append(Worsened(name, unseen, worst, was[worst], now[worst]))
    return found


def _or_nan(value: float | None) -> float:
    """NaN, which compares false with anything, for None."""
    return math.nan if value is None else value
