"""When an estimate may be trusted: its standard error is small, unseen samples agree, and nothing is missing."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

# Largest standard error, as part of the value.
LARGEST_STDERR = 0.05
# Largest rms error of the free run on unseen samples, in units of the sensor's noise: three quarters of its power are
# then the model's.
LARGEST_ERROR = 2.0


@dataclass(frozen=True)
class Standing:
    """What is known of the model that the estimates belong to.

    Attributes
    ----------
    missed : mapping of str to float
        By output, rms error of the free run on unseen samples over the sensor's noise.
    missing : tuple of str
        Effects for which there is evidence beyond the threshold.
    doubtful : tuple of str
        Effects that the samples have neither shown nor made unlikely.
    weighed : float
        New samples on which effects have been weighed [s]; 0 where they have not.
    unknown : bool
        Whether something is missing that is not in the catalogue.
    """

    missed: Mapping[str, float]
    missing: tuple[str, ...] = ()
    doubtful: tuple[str, ...] = ()
    weighed: float = 0.0
    unknown: bool = False

    def doubts(self, largest_error: float = LARGEST_ERROR) -> tuple[str, ...]:
        """Why no estimate of this model may be trusted, one line each; empty where nothing speaks against them.

        Parameters
        ----------
        largest_error : float
            In units of the sensor's noise.
        """
        found = [
            f"on unseen samples {name} is missed by {ratio:.3g} times its noise, more than {largest_error:g}"
            for name, ratio in self.missed.items()
            if not ratio <= largest_error
        ]
        if not self.missed:
            found.append("the model has not been compared with unseen samples")
        if self.missing:
            found.append(f"missing from the model: {', '.join(self.missing)}")
        if self.unknown:
            found.append("something is missing from the model that is not in the catalogue")
        if self.doubtful:
            found.append(f"not decided yet: {', '.join(self.doubtful)}")
        if not self.weighed:
            found.append("it has not been weighed yet whether an effect is missing")
        return tuple(found)


@dataclass(frozen=True)
class Trust:
    """Whether one estimate may be trusted, and why.

    Attributes
    ----------
    trusted : bool
    why : str
        What speaks against it; where nothing does, what holds.
    """

    trusted: bool
    why: str


def trust(
    value: float,
    stderr: float | None,
    standing: Standing,
    *,
    at_bound: bool = False,
    largest_stderr: float = LARGEST_STDERR,
    largest_error: float = LARGEST_ERROR,
) -> Trust:
    """Say whether an estimate may be trusted.

    Parameters
    ----------
    value, stderr : float
        The estimate and its standard error, None where there is none.
    standing : Standing
        Of the model.
    at_bound : bool
        Whether it lies on one of its bounds.
    largest_stderr : float
        As part of the value.
    largest_error : float
        On unseen samples, in units of the sensor's noise.
    """
    doubts, part = [], None
    if at_bound:
        doubts.append("it lies on its bound")
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
        f"nothing missing on {standing.weighed:.3g} s of new samples",
    )


def _percent(part: float) -> str:
    return f"{100.0 * part:.3g} %"
