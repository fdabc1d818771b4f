"""Suggestions in error messages about unknown names."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Sequence

from idloop.errors import InputError

_LONGEST = 80  # characters of a name that are shown


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return ``" (did you mean 'x'?)"`` for the nearest known name, or an empty text."""
    lowered = {item.lower(): item for item in known}
    close = difflib.get_close_matches(str(name).lower(), list(lowered), n=1, cutoff=0.6)
    return f" (did you mean {lowered[close[0]]!r}?)" if close else ""


def did_you_mean_or_known(name: str, known: Iterable[str]) -> str:
    """Return the nearest known name, or all of them."""
    names = list(known)
    return did_you_mean(name, names) or f" (known: {listed(names, 40)})"


def check_known(name: object, known: Iterable[str], what: str, limit: int = 12) -> None:
    """Raise InputError where `name` is not in `known`; `what` is missing, as in "a.csv: no column"."""
    names = list(known)
    if name not in names:
        raise InputError(f"{what} {name!r}; known: {listed(names, limit)}{did_you_mean(str(name), names)}")


def listed(names: Iterable[str], limit: int = 12) -> str:
    """Return names joined by commas; only the first `limit`, with the number of all."""
    every = [_printable(name) for name in names]
    shown = ", ".join(every[:limit])
    return shown + (f", ... ({len(every)} in all)" if len(every) > limit else "") if every else "none"


def joined_names(names: Sequence[str]) -> str:
    """Return names as in a sentence, such as "a, b and c"."""
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def counted(count: int, noun: str) -> str:
    """Return a number with its noun, such as "1 line" and "3 lines"."""
    return f"1 {noun}" if count == 1 else f"{count} {noun}s"


def is_or_are(count: int) -> str:
    """Return the verb of so many things."""
    return "is" if count == 1 else "are"


def _printable(name: str) -> str:
    """Printable form of a name from a file, of limited length."""
    return name if name.isprintable() and len(name) <= _LONGEST else repr(name[:_LONGEST])
