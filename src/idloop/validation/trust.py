"""Trust in an estimate: small standard error, agreement on unseen samples, and no missing effect."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

# Largest standard error, as part of the value.
LARGEST_STDERR = 0.05
# Largest rms error of the free run on unseen samples, in units of the sensor's noise: three quarters of its power are
# then model error.
LARGEST_ERROR = 2.0


@dataclass(frozen=True)
class ModelValidation:
    """Validation results of the model that the estimates belong to."""

    missed: Mapping[str, float]  # rms error of the free run on unseen samples over the sensor's noise, by output
    missing: tuple[str, ...] = ()  # effects with evidence above the threshold
    doubtful: tuple[str, ...] = ()  # effects that the samples neither support nor reject
    weighed: float = 0.0  # duration of new samples on which effects were tested [s]; 0 without a test
    unknown: bool = False  # whether an effect is missing that is not in the catalogue

    def doubts(self, largest_error: float = LARGEST_ERROR) -> tuple[str, ...]:
        """Reasons against all estimates of this model, one line each; empty without any.

        `largest_error`: in units of the sensor's noise.
        """
        found = [
            f"the error of {name} on unseen samples is {ratio:.3g} times its noise, more than {largest_error:g}"
            for name, ratio in self.missed.items()
            if not ratio <= largest_error
        ]
        if not self.missed:
            found.append("the model was not validated on unseen samples")
        if self.missing:
            found.append(f"missing effects: {', '.join(self.missing)}")
        if self.unknown:
            found.append("an effect is missing that is not in the catalogue")
        if self.doubtful:
            found.append(f"undecided effects: {', '.join(self.doubtful)}")
        if not self.weighed:
            found.append("missing effects were not tested yet")
        return tuple(found)


@dataclass(frozen=True)
class Trust:
    """Whether one estimate is trusted, and why."""

    trusted: bool
    why: str  # the reasons against it; without any, the results in its favour


def trust(
    value: float,
    stderr: float | None,
    standing: ModelValidation,
    *,
    at_bound: bool = False,
    largest_stderr: float = LARGEST_STDERR,
    largest_error: float = LARGEST_ERROR,
) -> Trust:
    """Decide whether an estimate is trusted.

    `value`, `stderr`: the estimate and its standard error, None where there is none; `standing`: validation results of
    the model; `at_bound`: whether it is at one of its bounds; `largest_stderr`: as part of the value; `largest_error`:
    on unseen samples, in units of the sensor's noise.
    """
    doubts, part = [], None
    if at_bound:
        doubts.append("it is at its bound")
    if stderr is None:
        doubts.append("it has no standard error")
    else:
        part = stderr / abs(value) if value else float("inf")
        if not part <= largest_stderr:
            doubts.append(f"its standard error is {_percent(part)} of it, more than {_percent(largest_stderr)}")
    doubts += standing.doubts(largest_error)
    if doubts or part is None:
        return Trust(False, "; ".join(doubts))
    worst = max(standing.missed.values())
    return Trust(
        True,
        f"standard error {_percent(part)}; errors on unseen samples at most {worst:.3g} times the noise; "
        f"no missing effect on {standing.weighed:.3g} s of new samples",
    )


def _percent(part: float) -> str:
    return f"{100.0 * part:.3g} %"
