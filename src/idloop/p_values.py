"""How a p-value is written."""

from __future__ import annotations

import math

_LEAST = 1e-3  # less is not spelled out


def p_value_text(p_value: float | None) -> str:
    """Write a p-value: "0.012", "< 0.001"; "-" where there is none."""
    if p_value is None:
        return "-"
    return f"{p_value:.2g}" if p_value >= _LEAST else f"< {_LEAST:g}"


def p_text(p_value: float | None) -> str:
    """Write "p = 0.012" or "p < 0.001"; empty where there is none."""
    if p_value is None or not math.isfinite(p_value):
        return ""
    return f"p {p_value_text(p_value)}" if p_value < _LEAST else f"p = {p_value_text(p_value)}"
