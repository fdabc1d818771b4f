"""Did-you-mean for names typed by people."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return ``"; did you mean 'x'?"`` when a known name is close to `name`, else an empty string."""
    close = get_close_matches(name, list(known), n=1, cutoff=0.6)
    return f"; did you mean {close[0]!r}?" if close else ""


def listed(names: Iterable[str], limit: int = 12) -> str:
    """Return names joined by commas, the tail counted instead of printed."""
    every = list(names)
    shown = ", ".join(every[:limit])
    return shown + (f", ... ({len(every)} in all)" if len(every) > limit else "") if every else "none"
