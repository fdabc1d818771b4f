"""The detection limit: the size from which on the data would show an effect."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from idloop.diagnosis.candidate import effect_parameters
from idloop.diagnosis.evidence.predictive import DEVIATIONS
from idloop.diagnosis.screening.score_test import Screened, Trace

# Ratio of the limits found in nine of ten simulated experiments to those of theory, as the free noise model absorbs a
# part of a weak effect (benchmarks/diagnosis/limits.py).
_ABSORBED = 2.5


@dataclass(frozen=True)
class DetectionLimit:
    """Value of a parameter from which on an effect is found in nine of ten experiments like this one."""

    parameter: str
    unit: str
    # Of the shapes and phases that were tried: for the one that the data show best, and worst; infinite for none.
    least: float
    sure: float
    # The effect shows up to this value: a joint shows when it is soft.
    at_most: bool = False

    def undetectable(self, value: float) -> bool:
        """Whether an effect of this value is too small to show at any shape."""
        return value > self.least if self.at_most else abs(value) < self.least

    @property
    def short(self) -> str:
        """For a table, such as "width ≥ 0.0123 V"; empty where no size would show."""
        if not math.isfinite(self.least) or self.least <= 0.0:
            return ""
        ends = [f"{value:.3g}" for value in (self.least, self.sure) if math.isfinite(value) and value > 0.0]
        reach = " to ".join(dict.fromkeys(ends))
        return f"{self.parameter.replace('_', ' ')} {'≤' if self.at_most else '≥'} {reach} {self.unit}".rstrip(" -")

    @property
    def text(self) -> str:
        """In words, such as "it would show with width ≥ 0.0123 V"; empty where no size would."""
        if not self.short:
            return ""
        by_shape = "" if f"{self.least:.3g}" == f"{self.sure:.3g}" else ", depending on its shape"
        return f"it would show with {self.short}{by_shape}"

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON; None where no size would show."""
        least, sure = (value if math.isfinite(value) else None for value in (self.least, self.sure))
        return {"parameter": self.parameter, "unit": self.unit, "least": least, "sure": sure, "at_most": self.at_most}

    @classmethod
    def from_dict(cls, document: dict[str, Any]) -> DetectionLimit:
        """Read what `to_dict` wrote."""
        least, sure = (math.inf if document[name] is None else float(document[name]) for name in ("least", "sure"))
        return cls(document["parameter"], document["unit"], least, sure, bool(document["at_most"]))


def needed_power(chance: float) -> float:
    """Twice the log-likelihood that an effect must gain by itself to be found in nine of ten experiments.

    The power of a small effect's trace grows with the square of its size; the statistic has a non-central chi-squared
    distribution (Kay, Fundamentals of Statistical Signal Processing II, section 6.5). Theory misses 5 % at this power.
    """
    return _ABSORBED**2 * (math.sqrt(max(chance, 0.0)) + DEVIATIONS) ** 2


def detection_limit(screened: Screened, chance: float) -> DetectionLimit | None:
    """The detection limit of an effect, by the traces of its screening.

    `chance` is the statistic that the best of the catalogue reaches by chance as often as the error rate allows. None
    for an effect without a strength, or one that would replace a simpler one.
    """
    proposal = screened.proposal
    # A split body shows when it is soft.
    at_most = proposal.effect.splits
    name = "stiffness" if at_most else proposal.effect.strength
    traces = [t for t in screened.traces if name in t.trials[0]]
    if not traces or name in proposal.held or proposal.replaces is not None:
        return None
    needed = needed_power(chance)
    unit = effect_parameters(proposal.model(traces[0].trials[0]), proposal.name)[name]["unit"]
    if at_most:
        # Not beyond the stiffest trial.
        stiffest = max(
            (t.trials[0][name] for t in traces if t.detectable >= needed * t.uneven),
            default=max(t.trials[0][name] * math.sqrt(t.detectable / (needed * t.uneven)) for t in traces),
        )
        return DetectionLimit(name, unit, stiffest, stiffest, at_most)
    neutral = proposal.effect.spec(name).neutral
    shapes: dict[tuple[tuple[str, float], ...], list[Trace]] = {}
    for trace in traces:
        shape = tuple(sorted((k, v) for k, v in trace.trials[0].items() if k != name))
        shapes.setdefault(shape, []).append(trace)
    best, worst = math.inf, 0.0
    for alike in shapes.values():
        # The trial nearest to the limit.
        near = min(alike, key=lambda t: abs(math.log(max(t.detectable, 1e-300) / needed)))
        size = abs(near.trials[0][name] - neutral)
        least, sure = (
            size * math.sqrt(needed * near.uneven / power) if power > 0.0 else math.inf
            for power in (near.detectable, near.weakest)
        )
        best, worst = min(best, least), max(worst, sure)
    return DetectionLimit(name, unit, best, worst)
