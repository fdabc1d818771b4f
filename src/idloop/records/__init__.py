"""Records: experiments as arrays, from bags, CSV, MAT, NPZ and JSON."""

from __future__ import annotations

from idloop.records.align import read_record, read_records
from idloop.records.bags.read import read_streams
from idloop.records.bags.stream import JointStream
from idloop.records.bags.write import make_stream, record_streams, write_bag
from idloop.records.finding import Finding
from idloop.records.from_model import record_from_model
from idloop.records.gaps import cut_at_gaps
from idloop.records.inspection.checks import check_commands, check_identifiable, check_record
from idloop.records.inspection.inspection import Inspection, inspect_bag
from idloop.records.record import Record

__all__ = [
    "Finding",
    "Inspection",
    "JointStream",
    "Record",
    "check_commands",
    "check_identifiable",
    "check_record",
    "cut_at_gaps",
    "inspect_bag",
    "make_stream",
    "read_record",
    "read_records",
    "read_streams",
    "record_from_model",
    "record_streams",
    "write_bag",
]
