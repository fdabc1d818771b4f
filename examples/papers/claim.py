"""What is claimed of a line of a row: in words, and as the test that decides it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any


@dataclass(frozen=True)
class Claim:
    """What must be so of ours. NaN bears out no claim.

    Attributes
    ----------
    text : str
        In words, without the unit.
    test : callable
        From ours to whether it is so.
    in_unit : bool
        Whether the text ends in a number of the line's unit.
    """

    text: str
    test: Callable[[Any], bool]
    in_unit: bool = True

    def words(self, unit: str) -> str:
        """The claim with its unit.

        Parameters
        ----------
        unit : str
            The line's; empty for words and pure numbers.
        """
        return f"{self.text} {unit}" if self.in_unit and unit else self.text

    def met(self, ours: float | str | None) -> bool:
        """Whether ours is as claimed."""
        return bool(self.test(ours))

    def of(self, value: float) -> Claim:
        """The same claim of a number that the line prints inside words."""
        return replace(self, test=lambda _: self.met(value))


def below(limit: float) -> Claim:
    """Less than a limit."""
    return Claim(f"< {limit:.5g}", lambda ours: ours < limit)


def at_most(limit: float) -> Claim:
    """A limit or less."""
    return Claim(f"≤ {limit:.5g}", lambda ours: ours <= limit)


def above(limit: float) -> Claim:
    """More than a limit."""
    return Claim(f"> {limit:.5g}", lambda ours: ours > limit)


def at_least(limit: float) -> Claim:
    """A limit or more."""
    return Claim(f"≥ {limit:.5g}", lambda ours: ours >= limit)


def between(low: float, high: float) -> Claim:
    """From one limit to the other, both included."""
    return Claim(f"{low:.5g} to {high:.5g}", lambda ours: low <= ours <= high)


def beyond(distance: float) -> Claim:
    """Farther from zero than a distance, to whichever side."""
    return Claim(f"beyond ± {distance:.3g}", lambda ours: abs(ours) > distance)


def near(centre: float, distance: float) -> Claim:
    """Nearer to a number than a distance."""
    tolerance = f"± {distance:.3g}"
    text = f"{centre:.5g} {tolerance}" if centre else tolerance
    return Claim(text, lambda ours: abs(ours - centre) < distance)


def within(centre: float, share: float) -> Claim:
    """As near to a number as a share of it, or nearer."""
    text = f"{centre:.5g} ± {100.0 * share:.3g} %"
    return Claim(text, lambda ours: abs(ours - centre) <= share * abs(centre), in_unit=False)


def within_errors(centre: float, count: float, stderr: float) -> Claim:
    """As near to a number as so many standard errors, or nearer."""
    far = count * stderr
    return Claim(f"{count:g} standard errors: ± {far:.3g}", lambda ours: abs(ours - centre) <= far)


def equals(wanted: float | str) -> Claim:
    """Exactly this number, or these words."""
    text = wanted if isinstance(wanted, str) else f"{wanted:.5g}"
    return Claim(f"= {text}", lambda ours: ours == wanted)


def stated(text: str, fulfilled: bool) -> Claim:
    """A claim in words, decided where it is made."""
    return Claim(text, lambda _: fulfilled, in_unit=False)
