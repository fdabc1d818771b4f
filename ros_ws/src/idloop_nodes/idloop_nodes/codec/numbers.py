"""Numbers that may be absent, as key values and in JSON, and what is uncertain for a person."""

from __future__ import annotations

import json
import math
from typing import Any

from idloop.json_values import to_json

# As in every printout and on every page: what stands after ± is the half-width of the 95 % interval.
_NORMAL_95 = 1.959963984540054


def text_or_empty(value: float | None) -> str:
    """Return the number in full precision, empty for None."""
    return "" if value is None else repr(float(value))


def number_or_none(text: str) -> float | None:
    """Return the number that `text_or_empty` wrote."""
    return float(text) if text else None


def plus_minus(stderr: float | None, digits: int = 2) -> str:
    """Return the half-width of the 95 % interval as " ± 0.0022"; empty where it is not known."""
    return "" if stderr is None or not math.isfinite(stderr) else f" ± {_NORMAL_95 * stderr:.{digits}g}"


def as_json(document: Any) -> str:
    """Return a document as JSON; what is no finite number becomes null."""
    return json.dumps(to_json(document), ensure_ascii=False, allow_nan=False)
