"""Parameters and ties in words."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from idloop.reporting.estimates import NORMAL_95
from idloop.reporting.text.blocks import number


def parameter_text(name: str, entry: Mapping[str, Any]) -> str:
    """Text of a parameter with its 95 % interval: "width 0.121 ± 0.002 V"; "(held)" where it was not estimated."""
    value, stderr, unit = entry.get("value"), entry.get("stderr"), (entry.get("unit") or "").removeprefix("-")
    if value is None:
        return f"{name} -"
    if stderr is None or not math.isfinite(stderr):
        return f"{name} {number(value)} {unit}".rstrip() + (" (held)" if entry.get("held") else "")
    if stderr == 0.0:  # read off the data
        return f"{name} {number(value, 6)} {unit}".rstrip()
    reach = NORMAL_95 * stderr
    # As many digits as the interval supports.
    digits = 2 if value == 0.0 or reach == 0.0 else max(2, 2 + math.ceil(math.log10(max(abs(value) / reach, 1.0))))
    return f"{name} {number(value, min(digits, 6))} ± {number(reach, 2)} {unit}".rstrip()


def parameters_text(parameters: Mapping[str, Mapping[str, Any]]) -> str:
    """Text of all parameters of an effect."""
    return ", ".join(parameter_text(name, entry) for name, entry in parameters.items())


def tie_text(tied: Sequence[str]) -> str:
    """Sentence about effects that the data cannot tell from the best one; empty without any."""
    if len(tied) < 2:
        return ""
    return f"this data cannot tell {tied[0]} from {', '.join(tied[1:])} (marked =)"
