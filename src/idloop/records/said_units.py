"""Units that an import wrote into a bag; a recording of JointState messages has none of its own."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any


def imported(custom: Mapping[str, str]) -> dict[str, Any]:
    """Return what an import said about the bag; nothing for other bags."""
    try:
        content = json.loads(custom.get("idloop.import", "{}"))
    except json.JSONDecodeError:
        return {}
    return content if isinstance(content, dict) else {}


def said_units(custom: Mapping[str, str]) -> dict[str, str]:
    """Return units by signal, such as ``motor.position``; an import writes them as ``topic joint.field``."""
    said = imported(custom).get("units", {})
    return {str(name).rpartition(" ")[2]: str(unit) for name, unit in said.items()} if isinstance(said, dict) else {}
