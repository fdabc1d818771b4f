"""Records: experiments as arrays, from bags and files of many forms. Names are imported on first use."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from idloop.records.align import read_record, read_records
    from idloop.records.bags.read import read_streams
    from idloop.records.bags.stream import JointStream
    from idloop.records.bags.write import make_stream, record_streams, write_bag
    from idloop.records.finding import Finding
    from idloop.records.from_model import record_from_model
    from idloop.records.gaps import cut_at_gaps, usable_parts
    from idloop.records.inspection.checks import check_commands, check_identifiable, check_record
    from idloop.records.inspection.inspection import Inspection, inspect_bag
    from idloop.records.inspection.together import compare_inspections
    from idloop.records.record import Record

__all__ = [
    "Finding",
    "Inspection",
    "JointStream",
    "Record",
    "check_commands",
    "check_identifiable",
    "check_record",
    "compare_inspections",
    "cut_at_gaps",
    "inspect_bag",
    "make_stream",
    "read_record",
    "read_records",
    "read_streams",
    "record_from_model",
    "record_streams",
    "usable_parts",
    "write_bag",
]

_MODULES = {
    "align": ("read_record", "read_records"),
    "bags.read": ("read_streams",),
    "bags.stream": ("JointStream",),
    "bags.write": ("make_stream", "record_streams", "write_bag"),
    "finding": ("Finding",),
    "from_model": ("record_from_model",),
    "gaps": ("cut_at_gaps", "usable_parts"),
    "inspection.checks": ("check_commands", "check_identifiable", "check_record"),
    "inspection.inspection": ("Inspection", "inspect_bag"),
    "inspection.together": ("compare_inspections",),
    "record": ("Record",),
}
_WHERE = {name: module for module, names in _MODULES.items() for name in names}


def __getattr__(name: str) -> Any:
    """Import a name on first use: a node that reads single messages needs neither numpy nor scipy."""
    if name not in _WHERE:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_WHERE[name]}"), name)
