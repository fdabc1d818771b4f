"""Captures that ControlDesk of dSPACE saves as MATLAB structures: the stamps in X, the signals in Y, by their paths."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping
from typing import Any

import numpy as np

from idloop.arrays import Array

_PART = re.compile(r'"([^"]*)"|([^"/]+)')
_PORT = re.compile(r"(?:In|Out)\d+")
_ROOT = "Model Root"


def series_of_capture(value: Any) -> dict[str, Any] | None:
    """Return the signals of a capture by the names of their blocks, with the stamps [s] of each as ``time``.

    Signals of several rates are in a structure for each.

    Returns: None for anything else.
    """
    if not isinstance(value, Mapping) or not value.keys() >= {"X", "Y"}:
        return None
    stamps, signals = _entries(value["X"]), _entries(value["Y"])
    if not stamps or not signals or not all(isinstance(one.get("Name"), str) for one in signals):
        return None
    if any((np.diff(one["Data"]) <= 0.0).any() for one in stamps):
        return None
    names = _names([one["Name"] for one in signals])
    rates: dict[int, dict[str, Array]] = {}
    for name, one in zip(names, signals, strict=True):
        place = int(one.get("XIndex", 1)) - 1
        if not 0 <= place < len(stamps) or len(stamps[place]["Data"]) != len(one["Data"]):
            return None
        rates.setdefault(place, {"time": stamps[place]["Data"]})[name] = one["Data"]
    several = list(rates.values())
    return several[0] if len(several) == 1 else {f"rate{place + 1}": one for place, one in rates.items()}


def _entries(value: Any) -> list[Mapping[str, Any]]:
    """Structures that hold a series as their Data; none where one of them does not."""
    several = [value] if isinstance(value, Mapping) else list(value) if isinstance(value, list | np.ndarray) else []
    good = all(isinstance(one, Mapping) and _is_series(one.get("Data")) for one in several)
    return several if good else []


def _is_series(data: Any) -> bool:
    return isinstance(data, np.ndarray) and data.ndim == 1 and data.dtype.kind in "biuf" and data.size > 1


def _names(paths: list[str]) -> list[str]:
    """Name each signal by its block, and by its whole path where two blocks have one name."""
    whole = ["/".join(_parts(path)) for path in paths]
    blocks = [_block(path) for path in paths]
    count = Counter(blocks)
    return [block if block and count[block] == 1 else path for block, path in zip(blocks, whole, strict=True)]


def _parts(path: str) -> list[str]:
    return [quoted or plain.strip() for quoted, plain in _PART.findall(path)]


def _block(path: str) -> str:
    """Return the last part of a path that is neither a port nor the root of the model."""
    return next((part for part in reversed(_parts(path)) if not _PORT.fullmatch(part) and part != _ROOT), "")
