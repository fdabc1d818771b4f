"""Units that an import wrote into a bag; a recording of JointState messages has none of its own."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from idloop.documents import read_json
from idloop.errors import InputError
from idloop.records.measured_conditions import FIELD

UNITS, _IMPORT = "idloop.condition_units", "idloop.import"


def imported(custom: Mapping[str, str]) -> dict[str, Any]:
    """Return what an import said about the bag; nothing for other bags."""
    return _said(custom, _IMPORT)


def _said(custom: Mapping[str, str], key: str) -> dict[str, Any]:
    try:
        content = read_json(custom.get(key, "{}"), key)
    except InputError:
        return {}
    return content if isinstance(content, dict) else {}


def said_units(custom: Mapping[str, str]) -> dict[str, str]:
    """Return units by signal, such as ``motor.position``; an import writes them as ``topic joint.field``."""
    said = imported(custom).get("units", {})
    return {str(name).rpartition(" ")[2]: str(unit) for name, unit in said.items()} if isinstance(said, dict) else {}


def condition_units(custom: Mapping[str, str]) -> dict[str, str]:
    """Return units by condition, such as ``temperature``, of a bag that an import or `write_bag` wrote."""
    said = {name.rpartition(".")[0]: unit for name, unit in said_units(custom).items() if name.endswith(f".{FIELD}")}
    return said | {name: str(unit) for name, unit in _said(custom, UNITS).items()}
