"""Units that an import wrote into a bag; a recording of JointState messages has none of its own."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from idloop.documents import read_json
from idloop.errors import InputError


def imported(custom: Mapping[str, str]) -> dict[str, Any]:
    """Return what an import said about the bag; nothing for other bags."""
    try:
        content = read_json(custom.get("idloop.import", "{}"), "idloop.import")
    except InputError:
        return {}
    return content if isinstance(content, dict) else {}


def said_units(custom: Mapping[str, str]) -> dict[str, str]:
    """Return units by signal, such as ``motor.position``; an import writes them as ``topic joint.field``."""
    said = imported(custom).get("units", {})
    return {str(name).rpartition(" ")[2]: str(unit) for name, unit in said.items()} if isinstance(said, dict) else {}
