"""Records from the samples of a simulation."""

from __future__ import annotations

from typing import TYPE_CHECKING

from idloop.arrays import Array
from idloop.records.record import Record

if TYPE_CHECKING:
    from idloop.physics.model import Model


def record_from_model(
    name: str, model: Model, time: Array, command: Array, output: Array, reference: Array | None = None
) -> Record:
    """Return samples as a record with the names and units of a model.

    `time` (n,): stamps of all samples [s].
    `command` (n,): in the unit of the model's input; held until the next stamp.
    `output` (n, p): in the order and units of the model's outputs.
    `reference` (n, 2): position and velocity that a controller followed; NaN = not given. None in open loop.
    """
    return Record(
        name=name,
        input_time=time,
        input=command,
        time=time,
        output=output,
        input_name=model.input.name,
        input_unit=model.input.unit,
        output_names=model.output_names,
        output_units=tuple(signal.unit for signal in model.outputs),
        reference_time=None if reference is None else time,
        reference=reference,
    )
