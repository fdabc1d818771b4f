"""The outcome of one method of identification, and of a sweep over one setting."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from idloop.estimation.black_box.method import Identified
    from idloop.estimation.black_box.sampled import SampledData
    from idloop.estimation.statistics.information_criteria import Information
    from idloop.validation.score import Score

_APART = 20.0  # FIT that a free run may lie below the prediction before that is said [%]
_SAME = 0.01  # a change of a free run's error by less than this part is worth no state
_BAND = 0.75  # of a command's power, what lies within its bandwidth: of levels held for T, that below 1/(2T)
_SIGMAS = 2.0  # standard errors within which two models do equally well


@dataclass(frozen=True, eq=False)
class Outcome:
    """The model that one method gave, and its scores."""

    label: str
    found: Identified | None = None  # None where it failed
    score: Score | None = None  # None for responses and failures
    information: Information | None = None
    error: str = ""
    record: str = ""  # the one that it was identified from, where each has a model of its own

    @property
    def states(self) -> int | None:
        """Number of states of a linear model."""
        linear = None if self.found is None else self.found.linear
        return None if linear is None else linear.order

    @property
    def largest_pole(self) -> float | None:
        """Size of a linear model's largest pole; None for others."""
        linear = None if self.found is None else self.found.linear
        return None if linear is None else float(max(abs(linear.poles), default=0.0))

    @property
    def stable(self) -> bool | None:
        """Whether a linear model's poles lie inside the unit circle; None for others."""
        return None if self.largest_pole is None else self.largest_pole < 1.0

    @property
    def hint(self) -> str:
        """What to know or try where one of free run and prediction falls far behind the other; empty elsewhere."""
        if self.score is None or self.found is None:
            return ""
        if self.found.method.name == "iv4" and float(self.score.ahead.mean()) < float(self.score.free_run.mean()):
            return (
                f"{self.score.steps} ahead is worse than the free run: iv4 fits the plant and no noise model, and its"
                " predictor takes 1/A for one, which passes sensor noise on; judge it by the free run, and take bj,"
                " armax or pem to predict"
            )
        if self.found.method.kind != "network":
            return ""
        if float(self.score.free_run.mean()) > float(self.score.ahead.mean()) - _APART:
            return ""
        more = f"more delays (--order {2 * self.found.order})" if isinstance(self.found.order, int) else "more delays"
        trained: Any = self.found.model
        focus = "" if trained.form == "parallel" else "--focus simulation, "
        linear = ", or narx-wavelet, which has a linear part" if self.found.method.name == "narx-neural" else ""
        return (
            "predicts but does not run free: what it looks back on is mostly sensor noise;"
            f" try {focus}{more} or a longer --sample-time{linear}"
        )

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers for JSON."""
        document: dict[str, Any] = {"label": self.label, "error": self.error or None, "hint": self.hint or None}
        if self.found is not None:
            document |= self.found.to_dict()
        if self.score is not None:
            document |= self.score.to_dict()
        return document | self.measures()

    def measures(self) -> dict[str, Any]:
        """States, stability and criteria."""
        known = self.information
        criteria = {key: getattr(known, key, None) for key in ("loss", "fpe", "aic", "bic")}
        return {"states": self.states, "stable": self.stable, "largest_pole": self.largest_pole, **criteria}


def on_the_same_samples(outcomes: Sequence[Outcome]) -> list[Outcome]:
    """Outcomes on the same data, with AIC and BIC that can be held against one another (`comparable`)."""
    from idloop.estimation.statistics.information_criteria import comparable

    told = iter(comparable([one.information for one in outcomes if one.information is not None]))
    return [one if one.information is None else replace(one, information=next(told)) for one in outcomes]


def excitation_measure(name: Literal["amplitude", "bandwidth"], data: Sequence[SampledData]) -> float:
    """Amplitude or bandwidth of the commands of a record.

    `name`: "amplitude" or "bandwidth", standard deviation [of the command], or frequency below which three quarters of
    its power lie [Hz]; `data`: stretches of the record.
    """
    import numpy as np

    around = np.mean(np.concatenate([one.input[:, 0] for one in data]))
    commands = [one.input[:, 0] - around for one in data]
    if name == "amplitude":
        return float(np.sqrt(np.mean(np.concatenate(commands) ** 2)))
    lines = [np.fft.rfftfreq(len(one), one.sample_time) for one in data]
    frequency = np.concatenate(lines)
    # Half of the power of every line but the first is at its negative frequency.
    power = np.concatenate(
        [np.abs(np.fft.rfft(u)) ** 2 / u.size * np.where(f > 0, 2.0, 1.0) for u, f in zip(commands, lines, strict=True)]
    )
    order = np.argsort(frequency, kind="stable")
    below = np.cumsum(power[order])
    return float(frequency[order][np.searchsorted(below, _BAND * below[-1])])


def best_values(rows: Sequence[tuple[float, Outcome]]) -> dict[str, float]:
    """Value of the best free run by method, the smaller of equals."""
    best: dict[str, tuple[float, float]] = {}
    for value, one in rows:
        fit = mean(one, "free_run")
        if math.isfinite(fit) and (one.label not in best or fit > best[one.label][0]):
            best[one.label] = (fit, value)
    return {label: value for label, (_, value) in best.items()}


def smallest_orders(rows: Sequence[tuple[float, Outcome]], judged: Sequence[SampledData]) -> dict[str, float]:
    """Least order by method whose free run is not worse than the best one's within the uncertainty of the difference.

    `rows`: orders and what they came to; `judged`: that all were judged on.
    """
    from idloop.validation.score import fit_difference

    least = {}
    for label, value in best_values(rows).items():
        own = [(at, one.score) for at, one in rows if one.label == label and one.score is not None]
        best = next(score for at, score in own if at == value)
        for at, score in sorted(own, key=lambda pair: pair[0]):
            behind, stderr = fit_difference(judged, best, score)
            worth = _SAME * (100.0 - float(best.free_run.mean()))
            if at == value or behind <= max(worth, _SIGMAS * stderr if math.isfinite(stderr) else 0.0):
                least[label] = at
                break
    return least


def mean(one: Outcome, measure: Literal["free_run", "ahead"]) -> float:
    """Mean FIT over the outputs [%]; NaN where there is no model, minus infinity where it runs away."""
    return math.nan if one.score is None else float(getattr(one.score, measure).mean())
