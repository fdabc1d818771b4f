"""Numbers that may be absent, as key values."""

from __future__ import annotations


def text_or_empty(value: float | None) -> str:
    """Return the number in full precision, empty for None."""
    return "" if value is None else repr(float(value))


def number_or_none(text: str) -> float | None:
    """Return the number that `text_or_empty` wrote."""
    return float(text) if text else None
