"""Records as checked arrays for the criteria, with quantities that are constant in a fit."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from idloop.arrays import Array, Integers
from idloop.errors import InputError
from idloop.estimation.force_balance.held_command import held_along
from idloop.estimation.observer.sensor_noise import noise_std
from idloop.estimation.sensors import body_sensors
from idloop.physics.conditions import Conditions, condition_name

if TYPE_CHECKING:
    from collections.abc import Sequence

    from idloop.physics import Engine, Model
    from idloop.records import Record


# Least number of samples for a fit.
FEWEST_SAMPLES = 20
# The opening segment of a record is one in so many samples, and at least so many samples.
_OPENING = 8
_FEWEST_OPENING = 1000


@dataclass(frozen=True)
class Data:
    """One record as checked, contiguous arrays."""

    name: str
    # shape (m,)
    input_time: Array
    input: Array
    time: Array  # shape (n,)
    output: Array  # shape (n, p): NaN where not measured
    sample_time: float  # median step of `time` [s]
    gaps: Integers  # first sample after each gap of more than 5 steps
    conditions: Conditions | None = None
    command_noise: float = 0.0  # standard deviation of the noise of a measured command

    def held_input(self) -> Array:
        """Command at each output instant, shape (n,)."""
        index = np.searchsorted(self.input_time, self.time + 1e-9, side="right") - 1
        return np.where(index >= 0, self.input[np.maximum(index, 0)], 0.0)

    def part(self, first: int, last: int, *, all_commands: bool = False) -> Data:
        """Samples of an index range, with all commands or those from the one held at the first sample on."""
        time = self.time[first:last]
        begin, end = 0, len(self.input)
        if not all_commands:
            begin = max(int(np.searchsorted(self.input_time, time[0], side="right")) - 1, 0)
            end = max(int(np.searchsorted(self.input_time, time[-1], side="right")), begin + 1)
        return replace(
            self,
            input_time=self.input_time[begin:end],
            input=self.input[begin:end],
            time=time,
            output=self.output[first:last],
            gaps=self.gaps[(self.gaps > first) & (self.gaps < last)] - first,
        )


def prepare(
    model: Model, records: Sequence[Record], *, companions: Sequence[Record] = (), keep_computed: bool = False
) -> list[Data]:
    """Check records against a model and convert them to arrays for the compiled simulator.

    A velocity that is computed from the position in any of the records counts as not measured
    (`idloop.records.inspection.differenced`): it is no second sensor.

    `companions`: further records of the same sensors, for the same check.
    `keep_computed`: keep computed velocities.
    Raises InputError: if there is no record, or one is too short, has other outputs than the model, infinite samples,
    or no measurement.
    """
    if len(records) == 0:
        raise InputError("no record to fit; give at least one bag")
    found = [_prepare(model, record) for record in records]
    for place, speed in [] if keep_computed else sorted(_computed([*records, *companions])):
        for data in found:
            if np.any(np.isfinite(data.output[:, place])):
                data.output[:, speed] = np.nan
    return found


def _computed(records: Sequence[Record]) -> set[tuple[int, int]]:
    """Columns of positions and of the velocities computed from them."""
    from idloop.records.inspection.differenced import differenced

    pairs = set()
    for record in records:
        names = record.output_names
        for one in differenced(record):
            place = f"{one.where.rpartition('.')[0]}.position"
            if {place, one.where} <= set(names):
                pairs.add((names.index(place), names.index(one.where)))
    return pairs


def _each_once(time: Array, value: Array) -> tuple[Array, Array]:
    """The last of the samples with the same stamp."""
    last = np.append(np.diff(time) > 0.0, True)
    return time[last], value[last]


def _prepare(model: Model, record: Record) -> Data:
    time = np.ascontiguousarray(record.time, dtype=float)
    output = np.array(record.output, dtype=float, order="C")
    input_time = np.ascontiguousarray(record.input_time, dtype=float)
    value = np.ascontiguousarray(record.input, dtype=float)
    where = f"record {record.name!r}"
    if len(time) < FEWEST_SAMPLES:
        raise InputError(f"{where} has {len(time)} samples; a fit needs at least {FEWEST_SAMPLES}: record for longer")
    if output.ndim != 2 or output.shape != (len(time), len(model.outputs)):
        raise InputError(
            f"{where} has outputs of shape {output.shape}; the model {model.name!r} wants "
            f"{len(model.outputs)}: {', '.join(o.name for o in model.outputs)}"
        )
    if len(value) == 0:
        raise InputError(f"{where} has no command samples; check the topic {model.input.topic!r}")
    if not np.all(np.isfinite(value)):
        raise InputError(f"{where} has commands that are NaN or infinite; cut or repair them first")
    if np.any(np.isinf(output)):
        raise InputError(f"{where} has infinite measurements; mark missing samples as NaN")
    if np.any(np.diff(time) <= 0.0) or np.any(np.diff(input_time) < 0.0):
        raise InputError(f"{where} has stamps that run backwards; split it where the clock was reset")
    if not np.any(np.isfinite(output)):
        raise InputError(f"{where} measures none of the model's outputs; all samples are NaN")
    step = np.diff(time)
    sample_time = float(np.median(step))
    gaps = np.flatnonzero(step > 5.0 * sample_time) + 1
    command_noise = 0.0
    if model.input.kind == "measured":
        command_noise = noise_std(value)
        input_time, value = held_along(*_each_once(input_time, value))
    conditions = _conditions(model, record)
    return Data(record.name, input_time, value, time, output, sample_time, gaps, conditions, command_noise)


def _conditions(model: Model, record: Record) -> Conditions | None:
    """Measured conditions of a record, checked against the effects of the model."""
    units = {one.name: one.unit for one in record.conditions}
    for active in (one for one in model.effects if one.effect.condition):
        name, unit = condition_name((active.at, active.effect.condition), units), active.effect.condition_unit
        if name not in units:
            raise InputError(
                f"record {record.name!r} holds no condition {name!r}, which {active.name} depends on; record it, name"
                " it under `conditions:` of the model file, or take the effect out"
            )
        if units[name] not in (unit, ""):
            raise InputError(
                f"record {record.name!r}: condition {name!r} is in {units[name]}, and {active.name} takes it in {unit};"
                " convert it by scale and offset"
            )
    return Conditions(record.conditions) if record.conditions else None


def common_conditions(data: Sequence[Data]) -> dict[str, str]:
    """Names and units of the conditions in all records."""
    several = [set() if d.conditions is None else set(d.conditions.units.items()) for d in data]
    return dict(sorted(set.intersection(*several))) if several else {}


def opening_segments(data: list[Data]) -> list[Data] | None:
    """First segments of all records, on which a search comes near the optimum at low cost.

    None where the records are short, or the command does not change in a segment.
    """
    short = []
    for d in data:
        count = len(d.time) // _OPENING
        if count < _FEWEST_OPENING:
            return None
        last = int(np.searchsorted(d.input_time, d.time[count - 1], side="right"))
        part = replace(
            d, input_time=d.input_time[:last], input=d.input[:last], time=d.time[:count], output=d.output[:count],
            gaps=d.gaps[d.gaps < count],
        )  # fmt: skip
        if last < 2 or np.ptp(part.input) == 0.0 or not np.any(np.isfinite(part.output)):
            return None
        short.append(part)
    return short


def output_noise(model: Model, data: list[Data]) -> Array:
    """Standard deviation of each output's measurement noise, shape (p,), positive.

    From the model file, else the median over the records of `noise_std`.
    """
    values = np.empty(len(model.outputs))
    for column, output in enumerate(model.outputs):
        if output.noise is not None and output.noise > 0.0:
            values[column] = output.noise
            continue
        found = [noise_std(d.output[:, column]) for d in data]
        found = [value for value in found if value > 0.0]
        values[column] = float(np.median(found)) if found else 1.0
    return values


def output_groups(data: list[Data]) -> list[list[int]]:
    """Groups of outputs that are measured at the same instants, as lists of columns.

    A group has one vector noise model; groups are treated as independent. Outputs without measurements are in no group.
    """
    known = np.concatenate([np.isfinite(d.output) for d in data])
    groups: list[list[int]] = []
    for column in range(known.shape[1]):
        if not np.any(known[:, column]):
            continue
        for group in groups:
            # Outputs of one message miss the same samples, up to single NaN.
            if np.mean(known[:, group[0]] != known[:, column]) < 0.02:
                group.append(column)
                break
        else:
            groups.append([column])
    return groups


def initial_motion(model: Model, data: Data) -> tuple[Array, Array]:
    """Position and velocity (bodies,) at the first sample, from the first few samples.

    Bodies without a sensor get the motion of the nearest body with one.
    """
    bodies = len(model.bodies)
    position, velocity = np.full(bodies, np.nan), np.full(bodies, np.nan)
    window = min(10, len(data.time))
    elapsed = data.time[:window] - data.time[0]
    for body, (place, speed) in enumerate(body_sensors(model)):
        if place is not None:
            y = data.output[:window, place] / model.outputs[place].scale
            known = np.isfinite(y)
            if np.sum(known) >= 4:
                velocity[body], position[body] = np.polyfit(elapsed[known], y[known], 1)
            elif np.any(known):
                position[body] = y[known][0]
        if speed is not None:
            y = data.output[:window, speed] / model.outputs[speed].scale
            known = np.isfinite(y)
            if np.any(known):
                velocity[body] = float(np.mean(y[known][:3]))
    return _filled_from_nearest(position), _filled_from_nearest(velocity)


def travel(model: Model, data: Data) -> float:
    """Typical travel of the bodies in a record [position unit], never 0."""
    spans = [1e-9]
    for place, speed in body_sensors(model):
        if place is not None and np.any(np.isfinite(data.output[:, place])):
            y = data.output[:, place] / model.outputs[place].scale
            spans.append(float(np.nanmax(y) - np.nanmin(y)))
        elif speed is not None and np.any(np.isfinite(data.output[:, speed])):
            y = data.output[:, speed] / model.outputs[speed].scale
            spans.append(float(np.nanstd(y)) * float(data.time[-1] - data.time[0]))
    return max(spans)


def _filled_from_nearest(values: Array) -> Array:
    """Values of all bodies, NaN replaced by the nearest value; 0 when there is none."""
    known = np.flatnonzero(np.isfinite(values))
    if len(known) == 0:
        return np.zeros_like(values)
    nearest = [known[int(np.argmin(np.abs(known - i)))] for i in range(len(values))]
    return np.asarray(values[nearest])


def force_scale(engine: Engine, data: list[Data]) -> float:
    """Typical drive force of the records, positive: gain times the command's root mean square."""
    linear = engine.linearise(None)
    gain = float(np.linalg.norm(linear.B)) / max(float(np.linalg.norm(linear.G)), 1e-300)
    level = float(np.sqrt(np.mean(np.concatenate([d.input for d in data]) ** 2)))
    return max(gain * level, 1e-12)
