"""Records from the streams of a bag: signals are selected, clocks checked, samples sorted and aligned."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from idloop.arrays import Array
from idloop.errors import InputError
from idloop.records.bags.bag import Bag
from idloop.records.bags.clock_runs import announced_runs, backwards_message, split_runs
from idloop.records.bags.metadata import condition_units, signal_units
from idloop.records.bags.read import read_streams
from idloop.records.bags.storage.storage_files import bag_name
from idloop.records.bags.stream import JointStream
from idloop.records.bags.topics import (
    APPLIED_COMMAND,
    applied_command_findings,
    applied_command_topic,
    resolve_topic,
    topic_beside,
)
from idloop.records.finding import Finding
from idloop.records.gaps import cut_at_gaps, usable_parts
from idloop.records.inspection.checks import check_commands, check_record
from idloop.records.inspection.clocks import clock_finding, stamp_findings, stamp_statistics, while_measured
from idloop.records.inspection.values import missing_values
from idloop.records.inspection.velocity_check import without_wrong_velocities
from idloop.records.measured_conditions import TOPIC as CONDITIONS
from idloop.records.measured_conditions import ConditionSources
from idloop.records.record import Record

if TYPE_CHECKING:
    from idloop.physics.model import InputSignal, Model, OutputSignal
    from idloop.records.bags.axis_signals import AxisSignals

    ModelSignals: TypeAlias = Model | AxisSignals

Stamps = NDArray[np.int64]

# Topics beside the command, and the two fields of theirs that a record keeps.
_BESIDE = {"reference": ("position", "velocity"), "excitation": ("position", "effort")}


def read_record(
    bag: Path | str,
    model: ModelSignals,
    *,
    stamps: Literal["header", "receive"] = "header",
    run: int | None = None,
    wrap: Mapping[str, float] | None = None,
    distro: str | None = None,
    check: bool = True,
) -> Record:
    """Read the command and the measurements that a model names as one record.

    Parameters
    ----------
    bag : Path or str
        rosbag2 directory, ``.mcap`` or ``.db3`` file.
    model : Model or AxisSignals
        Its ``input``, ``outputs`` and ``conditions`` give topic, joint, field and unit.
    stamps : {"header", "receive"}
        Which time counts. Messages without a stamp always use the receive time.
    run : int, optional
        Which run (from 0) of a bag in which the clock was set back; without it such a bag is refused.
    wrap : mapping of str to float, optional
        Range after which an encoder repeats, by output name: ``{"motor.position": 6.283185}``.
    distro : str, optional
        ROS distribution of message types that the bag does not define.
    check : bool
        Refuse what no fit can use (constant command, output never measured, infinities, too few samples), and leave out
        a velocity that is not the derivative of the recorded position.

    Returns
    -------
    Record
        Time 0 is the first measurement that has a command in force. Rows are the union of the stamps of all
        outputs, NaN where an output was not measured.

    Raises
    ------
    InputError
        Anything above, unknown topic or joint, clock running backwards, two clocks.
    """
    with Bag(bag, distro) as opened:
        records = _read_runs(opened, model, stamps, wrap, split=run is not None)
    if run is not None and not 0 <= run < len(records):
        raise InputError(f"{bag}: no run {run}; the bag holds {len(records)} (counted from 0)")
    record = records[run or 0]
    if check:
        record = check_record(record, held=model.input.kind == "held")
        (record,) = check_commands(without_wrong_velocities([record], output_scales(model)))
    return record


def read_records(
    bags: Path | str | Bag | Iterable[Path | str],
    model: ModelSignals,
    *,
    stamps: Literal["header", "receive"] = "header",
    split: bool = False,
    wrap: Mapping[str, float] | None = None,
    distro: str | None = None,
) -> list[Record]:
    """Read one or several bags as one experiment: a list of records.

    Parameters and errors as in `read_record`, but a command may be constant: beside other records, or for a comparison,
    such a record is informative. A bag that is open already decodes a topic once for all models. With `split` a bag in
    which the clock was set back gives one record for each run
    instead of an error. A record is cut where nothing was measured for long, see `cut_at_gaps`. A velocity that is not
    the derivative of the recorded position is left out of all records that do not contradict this.
    """
    several: list[Path | str | Bag] = [bags] if isinstance(bags, Path | str | Bag) else list(bags)
    records = []
    for one in several:
        with nullcontext(one) if isinstance(one, Bag) else Bag(one, distro) as bag:
            runs = _read_runs(bag, model, stamps, wrap, split=split)
        for record in runs:
            records += usable_parts(cut_at_gaps(record), partial(check_record, held=model.input.kind == "held"))
    return without_wrong_velocities(records, output_scales(model))


def output_scales(model: ModelSignals) -> dict[str, float]:
    """Factor of each output: its values divided by it are in the unit of its body."""
    return {f"{one.joint}.{one.field}": float(getattr(one, "scale", 1.0)) for one in model.outputs}


def _read_runs(
    bag: Bag, model: ModelSignals, stamps: str, wrap: Mapping[str, float] | None, *, split: bool
) -> list[Record]:
    if stamps not in ("header", "receive"):
        raise InputError(f"stamps {stamps!r} are unknown; use header or receive")
    path, topics = bag.path, bag.topics
    requested = resolve_topic(model.input.topic, topics, path)
    command = applied_command_topic(requested, topics)
    measured = [resolve_topic(output.topic, topics, path) for output in model.outputs]
    extra = {
        name: found
        for name in _BESIDE
        if (found := topic_beside(requested, name, topics)) in topics and topics[found].count
    }
    conditions = ConditionSources.of(model.conditions, topic_beside(requested, CONDITIONS, topics), topics)
    streams = read_streams(bag, {command, *measured, *extra.values(), *conditions.topics})
    units = condition_units(bag.custom)
    common = _unit_findings(model, signal_units(bag.custom)) + applied_command_findings(requested, command)
    if stamps == "receive":
        streams = {topic: replace(stream, stamp_ns=stream.receive_ns) for topic, stream in streams.items()}
    runs = {topic: split_runs(streams[topic]) for topic in dict.fromkeys((command, *measured))}
    resets = {topic: parts for topic, parts in runs.items() if len(parts) > 1}
    if resets and not split:
        raise InputError(backwards_message(path, streams, resets))
    counts = {topic: len(runs[topic]) for topic in (command, *measured)}
    if len(set(counts.values())) > 1:
        text = ", ".join(f"{topic}: {count}" for topic, count in counts.items())
        raise InputError(
            f"{path}: the clock was set back a different number of times on each topic (runs {text}); record one run"
            " per bag"
        )
    added = (*extra.values(), *conditions.topics)
    runs |= {topic: announced_runs(streams[topic], counts[command]) for topic in added if topic not in runs}
    records = []
    for number in range(counts[command]):
        # A reference that was latched before the reset has fewer runs: its last one stays in force.
        part = {topic: parts[min(number, len(parts) - 1)] for topic, parts in runs.items()}
        name = bag_name(path) if counts[command] == 1 else f"{bag_name(path)}[{number}]"
        record = _align(path, name, model, part, command, measured, extra)
        end_ns = int(record.absolute(record.time[-1:])[0])
        values, notes = conditions.read(part, units, record.start_ns, end_ns)
        record = replace(record, conditions=values, findings=(*record.findings, *common, *notes))
        for output, span in (wrap or {}).items():
            record = record.unwrapped(output, span)
        records.append(record)
    return records


def _unit_findings(model: ModelSignals, bag_units: Mapping[str, str]) -> list[Finding]:
    """Compare the model's units with those that an import wrote into the bag."""
    found = []
    for signal in (model.input, *model.outputs):
        where = f"{signal.joint}.{signal.field}"
        unit = bag_units.get(where, signal.unit)
        if unit != signal.unit:
            text = (
                f"{where} is in {unit or 'a unit that is not known'} in the bag and in {signal.unit} in the model; its"
                " values are used without conversion: correct the unit in the model file or in the mapping"
            )
            found.append(Finding("unit", text, where=where, level="warning"))
    return found


def _sorted_column(
    stream: JointStream, joint: str, field: str, *, command: bool
) -> tuple[Stamps, Array, list[Finding]]:
    """Return one column in the order of its stamps, NaN left out, one value per stamp."""
    try:
        value = stream.column(joint, field)
    except InputError as error:
        raise InputError(
            str(error),
            f"give --joint {joint}=NAME with its name there, or give input and outputs of the model file that joint",
        ) from error
    # A message with the command of another joint only is no gap in the command of this one.
    held = command and not np.isfinite(getattr(stream, field)[np.isnan(value)]).any()
    found = missing_values(f"{stream.topic} {joint}.{field}", stream.stamp_ns, value, stream.topic, command=held)
    known = ~np.isnan(value)
    stamp, value = stream.stamp_ns[known], value[known]
    order = np.argsort(stamp, kind="stable")
    stamp, value = stamp[order], value[order]
    if stamp.size > 1:
        repeated = stamp[1:] == stamp[:-1]
        # Of two commands with one stamp the later replaces the earlier; of two measurements the first counts.
        keep = np.append(~repeated, True) if command else np.insert(~repeated, 0, True)
        stamp, value = stamp[keep], value[keep]
    return stamp, value, found


def _align(
    path: Path,
    name: str,
    model: ModelSignals,
    streams: Mapping[str, JointStream],
    command: str,
    measured: Sequence[str],
    extra: Mapping[str, str],
) -> Record:
    findings: list[Finding] = []
    for topic in dict.fromkeys((command, *measured)):
        findings += streams[topic].findings
        stamps = streams[topic].stamp_ns
        if topic == command:
            stamps = while_measured(stamps, [streams[name].stamp_ns for name in measured])
        if not topic.endswith(f"/{APPLIED_COMMAND}"):  # a bridge may pause: its last command then holds
            findings += stamp_findings(topic, stamp_statistics(stamps), held=topic == command)
    input_ns, value, found = _sorted_column(streams[command], model.input.joint, model.input.field, command=True)
    findings += found
    if input_ns.size == 0:
        finite = [name for name, column in streams[command].columns().items() if np.isfinite(column).any()]
        given = " or ".join(name for name in finite if name.rpartition(".")[0] == model.input.joint)
        raise InputError(
            f"{path}: {command} {model.input.joint}.{model.input.field} is NaN in every message; "
            + (f"name {given} in the model file instead" if given else "check field and joint in the model file")
        )
    columns = []
    outputs: Sequence[InputSignal | OutputSignal] = model.outputs
    for topic, signal in zip(measured, outputs, strict=True):
        stamp, column, found = _sorted_column(streams[topic], signal.joint, signal.field, command=False)
        if stamp.size == 0:
            raise InputError(
                f"{path}: {topic} {signal.joint}.{signal.field} is NaN (not measured) in every message; take this"
                " output out of the model file"
            )
        columns.append((stamp, column))
        findings += found
    for topic in dict.fromkeys(measured):
        clocks = clock_finding(streams[command], streams[topic]) if topic != command else None
        if clocks is not None and clocks.kind == "two_clocks":
            raise InputError(f"{path}: {clocks.text}")
        findings += [clocks] if clocks is not None else []
    stamps = np.unique(np.concatenate([stamp for stamp, _ in columns]))
    output = np.full((stamps.size, len(columns)), np.nan)
    for index, (stamp, column) in enumerate(columns):
        output[np.searchsorted(stamps, stamp), index] = column
    keep, found = _commanded(path, stamps, input_ns, command)
    findings += found
    stamps, output = stamps[keep], output[keep]
    start_ns = int(stamps[0])
    first = max(int(np.searchsorted(input_ns, start_ns, side="right")) - 1, 0)
    last = int(np.searchsorted(input_ns, stamps[-1], side="right"))
    parts = {name: _pair(streams[topic], model.input.joint, _BESIDE[name], start_ns) for name, topic in extra.items()}
    reference_time, reference = parts.get("reference", (None, None))
    excitation_time, excitation = parts.get("excitation", (None, None))
    return Record(
        name=name,
        input_time=(input_ns[first:last] - start_ns) / 1e9,
        input=value[first:last],
        time=(stamps - start_ns) / 1e9,
        output=output,
        input_name=f"{model.input.joint}.{model.input.field}",
        input_unit=model.input.unit,
        output_names=tuple(f"{signal.joint}.{signal.field}" for signal in model.outputs),
        output_units=tuple(signal.unit for signal in model.outputs),
        reference_time=reference_time,
        reference=reference,
        excitation_time=excitation_time,
        excitation=excitation,
        start_ns=start_ns,
        findings=tuple(findings),
    )


def _pair(stream: JointStream, joint: str, fields: tuple[str, str], start_ns: int) -> tuple[Array | None, Array | None]:
    """Return reference or excitation of the driven joint as time (r,) and two columns (r, 2)."""
    if joint not in stream.names and len(stream.names) != 1:
        return None, None
    index = stream.names.index(joint) if joint in stream.names else 0
    table = np.column_stack([getattr(stream, field)[:, index] for field in fields])
    stamp, first = np.unique(stream.stamp_ns, return_index=True)
    known = ~np.isnan(table[first]).all(axis=1)
    if not known.any():
        return None, None
    return (stamp[known] - start_ns) / 1e9, table[first][known]


def _commanded(path: Path, stamps: Stamps, input_ns: Stamps, command: str) -> tuple[slice, list[Finding]]:
    """Keep the measurements during which a command was in force."""
    step = np.diff(input_ns)
    # The last command is held for the longest pause between commands, or for ten periods.
    held = max(int(step.max()), int(10 * np.median(step))) if step.size else int(stamps[-1] - stamps[0])
    first = int(np.searchsorted(stamps, input_ns[0], side="left"))
    last = int(np.searchsorted(stamps, input_ns[-1] + held, side="right"))
    if last - first < 1:
        raise InputError(
            f"{path}: no measurement lies between the first and the last command on {command}; record both topics"
            " over the same time"
        )
    # One or two measurements before the first command are usual: a controller answers what it measures.
    left_out = {"before the first": stamps[: first + 1], "after the last": stamps[last - 1 :]}
    found = [
        Finding(
            "cut",
            f"{part.size - 1} measurements ({(part[-1] - part[0]) * 1e-9:.4g} s) {where} command are left out, because"
            " the command is not known there",
            part.size - 1,
            command,
        )
        for where, part in left_out.items()
        if part.size > 3
    ]
    return slice(first, last), found
