"""Parameters and ties in words, the same on the page, in the report and in a terminal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from idloop.reporting.estimates import with_interval
from idloop.validation.words import figure_text


def parameter_text(name: str, entry: Mapping[str, Any]) -> str:
    """Text of a parameter with its 95 % interval: "width 0.1210 ± 0.0021 V"; "(held)" where it was not estimated."""
    value, stderr, unit = entry.get("value"), entry.get("stderr"), (entry.get("unit") or "").strip("-")
    if value is None:
        return f"{name} -"
    # Without an error it was read off the data.
    number = figure_text(value, 6) if stderr == 0.0 else with_interval(value, stderr)
    return f"{name} {number} {unit}".rstrip() + (" (held)" if entry.get("held") else "")


def parameters_text(parameters: Mapping[str, Mapping[str, Any]]) -> str:
    """Text of all parameters of an effect."""
    return ", ".join(parameter_text(name, entry) for name, entry in parameters.items())


def tie_text(tied: Sequence[str]) -> str:
    """Sentence about effects that the data cannot tell from the best one; empty without any."""
    if len(tied) < 2:
        return ""
    return f"this data cannot tell {tied[0]} from {', '.join(tied[1:])} (marked =)"
