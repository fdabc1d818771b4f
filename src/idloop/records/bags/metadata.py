"""What an import or `write_bag` writes into the metadata of a bag: units, which JointState messages do not carry."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from idloop.documents import read_json
from idloop.errors import InputError

IMPORT, CONDITION_UNITS = "idloop.import", "idloop.condition_units"


def _section(metadata: Mapping[str, str], key: str) -> dict[str, Any]:
    try:
        content = read_json(metadata.get(key, "{}"), key)
    except InputError:
        return {}
    return content if isinstance(content, dict) else {}


def import_metadata(metadata: Mapping[str, str]) -> dict[str, Any]:
    """Return what an import wrote about the bag; nothing for other bags."""
    return _section(metadata, IMPORT)


def signal_units(metadata: Mapping[str, str]) -> dict[str, str]:
    """Return units by signal, such as ``motor.position``; an import writes them as ``topic joint.field``."""
    units = import_metadata(metadata).get("units", {})
    return {str(name).rpartition(" ")[2]: str(unit) for name, unit in units.items()} if isinstance(units, dict) else {}


def condition_units(metadata: Mapping[str, str]) -> dict[str, str]:
    """Return units by condition, such as ``temperature``; conditions are positions on their topic."""
    units = {
        name.rpartition(".")[0]: unit for name, unit in signal_units(metadata).items() if name.endswith(".position")
    }
    return units | {name: str(unit) for name, unit in _section(metadata, CONDITION_UNITS).items()}
