"""Refuse records that no fit can use, with one line each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from idloop.arrays import Array, Integers
from idloop.errors import InputError
from idloop.records.finding import Finding
from idloop.records.inspection.differenced import differenced
from idloop.records.inspection.measured_input import measured_input
from idloop.records.inspection.motion import Motion, analyse_motion, beginnings
from idloop.records.inspection.repeats import without_repeats
from idloop.records.inspection.values import LARGEST, bad_readings, unusable_magnitude, without_bad_readings
from idloop.records.record import Record

FEWEST_SAMPLES = 10
_FEW_SAMPLES = 100  # below, a fit runs, but noise and effects look alike


def dead_positions(motions: Mapping[str, Motion]) -> list[str]:
    """Return a sentence for each position that is constant while the velocity of its joint moves.

    `motions`: by ``joint.field``.
    """
    found = []
    for name, motion in motions.items():
        joint, _, field = name.rpartition(".")
        velocity = motions.get(f"{joint}.velocity")
        if field == "position" and motion.minimum == motion.maximum and velocity is not None and velocity.moves:
            found.append(
                f"{name} stays at {motion.minimum:g} while {joint}.velocity runs from {velocity.minimum:.4g} to"
                f" {velocity.maximum:.4g}: its sensor is dead or its column is another signal; correct the mapping, or"
                f" take {name} out of the model file"
            )
    return found


def few_samples(count: int, duration: float) -> str:
    """Return what there is to say of a record of `count` samples over `duration` [s]; empty where they are enough."""
    if count >= _FEW_SAMPLES:
        return ""
    return (
        f"only {count} samples in {duration:.3g} s, too few to separate effects from noise: estimates are hardly"
        " reliable; record some seconds of motion to and fro"
    )


def check_record(record: Record, *, held: bool = True) -> Record:
    """Return the record with findings on outputs that never move or are differences of another, and on few samples.

    Readings off the course of all others are marked as not measured, those of the command are replaced by the value
    before; so are values that a log repeats which is faster than its sensor. A finding counts them.

    `held`: whether the command is held, so that one that was measured is worth a finding.
    Raises InputError: infinite samples, an output never measured, fewer than ten samples.
    """
    name = record.name
    if (bad := np.flatnonzero(~np.isfinite(record.input))).size:
        kind = "NaN" if np.isnan(record.input[bad[0]]) else "infinite"
        raise InputError(
            f"{name}: {record.input_name} is {kind} at {record.input_time[bad[0]]:.6g} s (sample {bad[0]}); cut this"
            " part out or correct the source"
        )
    for output, values in _outputs(record).items():
        count = int(np.isfinite(values).sum())
        if (bad := np.flatnonzero(np.isinf(values))).size:
            raise InputError(
                f"{name}: {output} is infinite at {record.time[bad[0]]:.6g} s (sample {bad[0]}); cut this part out or"
                " mark it NaN (not measured)"
            )
        if count == 0:
            raise InputError(
                f"{name}: {output} is NaN (not measured) in the whole record; take this output out of the model file"
            )
        if count < FEWEST_SAMPLES:
            raise InputError(
                f"{name}: {output} has only {count} samples, at least {FEWEST_SAMPLES} are needed; record longer"
            )
    record = _without_bad_readings(_without_repeats(record))
    outputs = _outputs(record)
    for signal, values in [(record.input_name, record.input), *outputs.items()]:
        if unusable := unusable_magnitude(signal, float(np.nanmin(values)), float(np.nanmax(values))):
            raise InputError(f"{name}: {unusable}")
    found = [
        Finding("no_motion", f"{output} never changes", where=output, level="warning")
        for output, values in outputs.items()
        if np.nanmax(values) == np.nanmin(values)
    ]
    found += [one for one in differenced(record) if one not in record.findings]
    if held:
        found += measured_input(record.input_name, record.input_time, record.input, record.time, outputs)
    if short := few_samples(record.time.size, record.duration):
        found.append(Finding("few_samples", short, record.time.size, name, "warning"))
    return replace(record, findings=(*record.findings, *found))


def _outputs(record: Record) -> dict[str, Array]:
    return dict(zip(record.output_names, record.output.T, strict=True))


def _without_bad_readings(record: Record) -> Record:
    rows = bad_readings(record.input)
    outputs = _stray(record)
    found = []
    for name, bad in ((record.input_name, rows), *outputs.items()):
        if bad.size:
            many, left = ("1 value", "it is") if bad.size == 1 else (f"{bad.size} values", "they are")
            text = f"{name}: {many} off the course of all others: single bad readings, {left} left out"
            found.append(Finding("spikes", text, bad.size, name, "warning"))
    if not found:
        return record
    good = np.delete(np.arange(record.input.size), rows)
    before = good[np.maximum(np.searchsorted(good, np.arange(record.input.size), side="right") - 1, 0)]
    output = record.output.copy()
    for name, bad in outputs.items():
        output[bad, record.column(name)] = np.nan
    return replace(record, input=record.input[before], output=output, findings=(*record.findings, *found))


def _stray(record: Record) -> dict[str, Integers]:
    """Bad readings of the outputs: those far outside of all others, then those off the course of their neighbours."""
    from idloop.records.inspection.axis import Axis
    from idloop.records.inspection.faults.spikes import stray

    columns = _outputs(record)
    found = {name: bad_readings(values) for name, values in columns.items()}
    left = {name: without_bad_readings(values) for name, values in columns.items()}
    # What cannot be computed with is refused below.
    if any(np.nanmax(np.abs(values), initial=0.0) > LARGEST for values in left.values()):
        return found
    for joint in dict.fromkeys(name.rpartition(".")[0] for name in columns):
        position, velocity = (left.get(f"{joint}.{field}") for field in ("position", "velocity"))
        axis = Axis(joint, record.time, position, velocity, record.input_time, record.input)
        for name, rows in stray(axis).items():
            found[name] = np.union1d(found[name], rows)
    return found


def _without_repeats(record: Record) -> Record:
    output = np.column_stack([without_repeats(values) for values in record.output.T])
    found = []
    for name, values, fresh in zip(record.output_names, record.output.T, output.T, strict=True):
        if count := int(np.isfinite(values).sum() - np.isfinite(fresh).sum()):
            text = f"{name}: {count} values repeat the one before, the sensor is slower than the log: not measured"
            found.append(Finding("repeated_samples", text, count, name, "warning"))
    if not found:
        return record
    # A row without anything new is none: the force balance needs the rate of the sensor.
    kept = np.isfinite(output).any(axis=1) | ~np.isfinite(record.output).any(axis=1)
    return replace(record, time=record.time[kept], output=output[kept], findings=(*record.findings, *found))


def check_commands(records: Sequence[Record]) -> list[Record]:
    """Refuse records whose commands are all constant at one level, unless one of them begins with a step from rest.

    A record with a constant command is informative beside others: with a step that began with the record, or a
    coast-down. So are steps from rest to several levels, each of which has a record of its own.

    `records`: all records of a fit.
    Returns: the same; where there is a step to one level only, the first has a finding on what that does not show.
    Raises InputError: all commands are one constant, and no record begins with a step from rest.
    """
    records = list(records)
    if not records or not one_level([record.input for record in records]):
        return records
    first, same = records[0], "" if len(records) == 1 else ", and the same in the others"
    what = f"the command {first.input_name} is constant ({first.input[0]:g} {first.input_unit}){same}"
    if not excites(records):
        late = [record for record in records if first.input[0] != 0.0 and "late" in beginnings(record)]
        if late:
            start = beginnings(late[0])["late"]
            raise InputError(
                f"{first.name}: {what}, but the axis starts only at {start:.4g} s in {late[0].name}: the time of the"
                " step is not recorded; record it, or leave out what is before it with `rows:` of the mapping"
            )
        raise InputError(
            f"{first.name}: {what}, nothing can be identified from it; excite the axis, e.g. with a multisine or steps"
            " to several levels, or begin the record with the step, from rest"
        )
    text = (
        f"{what}: a step from rest shows a gain and a time constant at this level only, and a dead zone, friction or a"
        " saturation looks like a smaller gain; record steps to several levels"
    )
    found = Finding("one_level", text, where=first.input_name, level="warning")
    return [replace(first, findings=(*first.findings, found)), *records[1:]]


def one_level(inputs: Sequence[Array]) -> bool:
    """Whether all commands together have one value only."""
    return bool(np.ptp(np.concatenate(inputs)) == 0.0)


def excites(records: Sequence[Record]) -> bool:
    """Whether something can be identified: the command changes, or a record begins with a step from rest."""
    if not one_level([record.input for record in records]):
        return True
    return records[0].input[0] != 0.0 and any("from rest" in beginnings(record) for record in records)


def check_identifiable(record: Record) -> Record:
    """Return the record if its motion can be fitted; a comparison or a monitor also accepts one without motion.

    Raises InputError: no output changes, or a position stands still beside its moving velocity.
    """
    found = {name: analyse_motion(values) for name, values in _outputs(record).items()}
    motions = {name: motion for name, motion in found.items() if motion is not None}
    for dead in dead_positions(motions):
        raise InputError(f"{record.name}: {dead}")
    if all(motion.minimum == motion.maximum for motion in motions.values()):
        raise InputError(
            f"{record.name}: nothing moves, {', '.join(motions)} never changes; command a larger motion, or check the"
            " sensors and the columns"
        )
    return record
