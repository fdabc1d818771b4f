"""Records: experiments as arrays, from bags, CSV, MAT, NPZ and JSON."""

from __future__ import annotations

from idloop.records.align import read_record, read_records
from idloop.records.checks import check_commands, check_identifiable, check_record
from idloop.records.finding import Finding
from idloop.records.from_model import record_from_model
from idloop.records.gaps import cut_at_gaps
from idloop.records.inspection import Inspection, inspect_bag
from idloop.records.read import read_streams
from idloop.records.record import Record
from idloop.records.stream import JointStream
from idloop.records.write import make_stream, record_streams, write_bag

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
