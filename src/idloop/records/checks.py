"""What no fit can use is refused here, each with one line."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from idloop.errors import InputError
from idloop.records.finding import Finding
from idloop.records.record import Record

FEWEST_SAMPLES = 10


def check_record(record: Record) -> Record:
    """Return the record, with a finding for every output that never moves.

    Raises
    ------
    InputError
        Infinite samples, an output never measured, fewer than ten samples, a constant command.
    """
    name = record.name
    if not np.isfinite(record.input).all():
        k = int(np.flatnonzero(~np.isfinite(record.input))[0])
        kind = "NaN" if np.isnan(record.input[k]) else "infinite"
        raise InputError(
            f"{name}: {record.input_name} is {kind} at {record.input_time[k]:.6g} s (sample {k}); cut this part out"
            " or mend the source"
        )
    for column, output in enumerate(record.output_names):
        values = record.output[:, column]
        if np.isinf(values).any():
            k = int(np.flatnonzero(np.isinf(values))[0])
            raise InputError(
                f"{name}: {output} is infinite at {record.time[k]:.6g} s (sample {k}); cut this part out"
                " or mark it NaN (not measured)"
            )
        count = int(np.isfinite(values).sum())
        if count == 0:
            raise InputError(
                f"{name}: {output} is NaN (not measured) in the whole record; take this output out of the model file"
            )
        if count < FEWEST_SAMPLES:
            raise InputError(
                f"{name}: {output} has only {count} samples, at least {FEWEST_SAMPLES} are needed; record longer"
            )
    if np.ptp(record.input) == 0:
        raise InputError(
            f"{name}: the command {record.input_name} is constant ({record.input[0]:g} {record.input_unit}), nothing"
            " can be identified from it; excite the axis, e.g. with a multisine"
        )
    still = [
        Finding("no_motion", f"{output} never changes", where=output, level="warning")
        for column, output in enumerate(record.output_names)
        if np.nanmax(record.output[:, column]) == np.nanmin(record.output[:, column])
    ]
    return replace(record, findings=(*record.findings, *still))
