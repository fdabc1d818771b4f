"""One signal of a record, by name."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from idloop.errors import InputError
from idloop.estimation.describing_functions.harmonics import Floats
from idloop.records import Record
from idloop.spelling import did_you_mean_or_known


@dataclass(frozen=True, eq=False)
class RecordedSignal:
    """Stamps and values of one signal, what was not measured left out.

    `name`, `unit`: as in the record; the unit of a reference or excitation is not recorded; `time`, `value` (n,):
    stamps [s] and values.
    """

    name: str
    unit: str
    time: Floats
    value: Floats
    held: bool  # held from each stamp to the next (command, reference, excitation), or sampled (outputs)


def recorded_signal(record: Record, name: str) -> RecordedSignal:
    """Find a signal: the command, an output, or a column of the reference or the excitation.

    `record`: the experiment; `name`: ``record.input_name``, one of ``record.output_names``, ``reference.position``,
    ``reference.velocity``, ``excitation.position`` or ``excitation.effort``. Raises InputError: no such signal, or it
    was never measured.
    """
    known: dict[str, tuple[Floats, Floats, str, bool]] = {
        record.input_name: (record.input_time, record.input, record.input_unit, True)
    }
    for column, output in enumerate(record.output_names):
        known[output] = (record.time, record.output[:, column], record.output_units[column], False)
    for kind, fields in (("reference", ("position", "velocity")), ("excitation", ("position", "effort"))):
        when, what = getattr(record, f"{kind}_time"), getattr(record, kind)
        if when is not None and what is not None:
            for column, field in enumerate(fields):
                known[f"{kind}.{field}"] = (when, what[:, column], "", True)
    if name not in known:
        raise InputError(f"{record.name}: no signal {name!r}{did_you_mean_or_known(name, known)}")
    time, value, unit, held = known[name]
    there = np.isfinite(value)
    if there.sum() < 2:
        raise InputError(f"{record.name}: {name} was not measured; choose another signal")
    return RecordedSignal(name, unit, time[there], value[there], held)
