"""Import of foreign files and bags into a bag of our topics, by a mapping."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from idloop.arrays import Array
from idloop.errors import InputError
from idloop.records.bags.metadata import IMPORT
from idloop.records.bags.storage.bag_paths import is_bag
from idloop.records.bags.stream import JointStream
from idloop.records.bags.write import make_stream, write_bag
from idloop.records.finding import Finding
from idloop.records.inspection.clocks import stamp_findings, stamp_statistics
from idloop.records.inspection.values import missing_values
from idloop.records.measured_conditions import TOPIC as CONDITIONS
from idloop.records.tables.mapping import Mapping, Signals, load_mapping
from idloop.records.tables.signals import Signal, signals_from_bag, signals_from_table
from idloop.records.tables.table import Table, joined_tables
from idloop.records.tables.table_files import read_table
from idloop.spelling import counted, listed

Stamps = NDArray[np.int64]


@dataclass(frozen=True)
class Imported:
    """Result of an import."""

    # The bag written and the file read
    bag: Path
    source: Path
    # Name of the mapping and of the part ("" where the file is one record)
    mapping: str
    part: str
    samples: int  # measurements written
    # Span and median interval of the measurements [s]
    duration: float
    period: float
    channels: dict[str, str]  # unit of each signal written, such as ``joint_command motor.effort``
    attributes: dict[str, float | str]  # single values found beside the data (gains, masses)
    findings: tuple[Finding, ...]  # remarks on the data
    notes: tuple[str, ...]  # notes of the mapping on this data

    def to_dict(self) -> dict[str, object]:
        """Return plain values, schema ``idloop/import/1``."""
        plain = {name: list(value) if isinstance(value, tuple) else value for name, value in asdict(self).items()}
        return {"schema": "idloop/import/1", **plain, "bag": str(self.bag), "source": str(self.source)}


def import_bag(
    source: Path | str, bag: Path | str, mapping: Mapping | str | Path, *, part: str | None = None
) -> Imported:
    """Turn a file into a bag of our topics.

    `source`: a file of any known form, or a foreign bag.
    `bag`: bag to write; must not exist.
    `mapping`: a mapping, the name of a ready one, or a mapping file.
    `part`: which record of a file that holds several.
    Raises InputError: source, mapping or target cannot be used; the message says why.
    """
    mapping = mapping if isinstance(mapping, Mapping) else load_mapping(mapping)
    source, bag = Path(source), Path(bag)
    signals = mapping.for_part(part)
    if bag.exists():
        raise InputError(f"{bag}: exists already and is not overwritten; choose another name or remove it")
    attributes: dict[str, float | str] = {}
    findings: list[Finding] = []
    if mapping.format == "bag" or (mapping.format is None and not mapping.files and is_bag(source)):
        read = signals_from_bag(source, mapping, signals)
    else:
        table = _table(source, mapping, signals)
        read = signals_from_table(table, mapping, signals)
        findings += [Finding("how_it_is_written", f"{source.name}: {note}") for note in table.notes]
        attributes = {name: table.attributes[name] for name in mapping.attributes if name in table.attributes}
    _check(source, read)
    streams = _streams(read)
    channels = {signal.name: signal.unit for signal in read}
    statistics = {stream.topic: stamp_statistics(stream.stamp_ns) for stream in streams}
    for topic, of_topic in statistics.items():
        if topic != CONDITIONS:  # at any rate: they are interpolated linearly
            findings += stamp_findings(topic, of_topic, held=topic == "joint_command")
    findings += _value_findings(read)
    origin = {
        "mapping": mapping.name,
        "part": part or "",
        "source": source.name,
        "files": mapping.files,
        "units": channels,
        "attributes": attributes,
        "notes": mapping.notes,
        "cite": mapping.cite,
    }
    write_bag(bag, streams, custom={IMPORT: json.dumps(origin)})
    measured = next((stream for stream in streams if stream.topic == "joint_states"), streams[0])
    return Imported(
        bag=bag,
        source=source,
        mapping=mapping.name,
        part=part or "",
        samples=len(measured),
        duration=statistics[measured.topic].duration,
        period=statistics[measured.topic].period,
        channels=channels,
        attributes=attributes,
        findings=tuple(findings),
        notes=tuple(mapping.notes),
    )


def _table(source: Path, mapping: Mapping, signals: Signals) -> Table:
    """Return the table of a file, or of the files of a folder that the mapping joins."""
    rows = slice(signals.rows.start, signals.rows.stop)
    options = {**mapping.csv.model_dump(), "entries": mapping.entries, "rows": rows}
    # Who says how a text is laid out means a text.
    kind = mapping.format or ("csv" if mapping.csv.model_fields_set else None)
    if not mapping.files:
        return read_table(source, kind, options)
    if not source.is_dir():
        raise InputError(
            f"{source}: mapping {mapping.name} joins {listed(mapping.files)}; give the folder that holds them"
        )
    for name in mapping.files:
        if not (source / name).resolve().is_relative_to(source.resolve()):
            raise InputError(f"mapping {mapping.name}: files: {name!r} lies outside of {source}")
    return joined_tables(source, [read_table(source / name, kind, options) for name in mapping.files])


def _check(source: Path, signals: list[Signal]) -> None:
    for signal in signals:
        if signal.value.size == 0:
            raise InputError(f"{source}: {signal.name} has no samples; check `rows:` and the file")
        if np.isinf(signal.value).any():
            k = int(np.flatnonzero(np.isinf(signal.value))[0])
            raise InputError(
                f"{source}: {signal.name} is infinite in row {k}; correct the file or leave the row out with `rows:`"
            )
        if np.isnan(signal.value).all():
            raise InputError(f"{source}: {signal.name} is empty (NaN) in every row; choose another column")
    name, count = Counter(signal.name for signal in signals).most_common(1)[0]
    if count > 1:
        raise InputError(f"{source}: two columns become {name}; give one of them another `joint:`")


def _streams(signals: list[Signal]) -> list[JointStream]:
    streams = []
    for topic in dict.fromkeys(signal.topic for signal in signals):
        own = [signal for signal in signals if signal.topic == topic]
        # Signals of one source message share their stamps; others are merged, NaN where not measured.
        if all(np.array_equal(signal.stamp_ns, own[0].stamp_ns) for signal in own):
            stamp, receive = own[0].stamp_ns, own[0].receive_ns
            columns = [signal.value for signal in own]
        else:
            stamp, receive, columns = _merged(own)
        known = ~np.isnan(np.column_stack(columns)).all(axis=1)
        joints: dict[str, dict[str, Array]] = {}
        for signal, column in zip(own, columns, strict=True):
            joints.setdefault(signal.joint, {})[signal.field] = column[known]
        streams.append(make_stream(topic, stamp[known], joints, receive[known]))
    return streams


def _merged(signals: list[Signal]) -> tuple[Stamps, Stamps, list[Array]]:
    """Merge signals with stamps of their own, run by run of the clock; NaN where one was not measured.

    A row is received no sooner than those before it: a signal that was stamped where it was measured arrives later than
    one beside it whose stamps are its arrival.
    """
    runs = [np.split(np.arange(one.stamp_ns.size), stamp_statistics(one.stamp_ns).resets) for one in signals]
    if len({len(parts) for parts in runs}) > 1:
        text = ", ".join(f"{one.name}: {len(parts)}" for one, parts in zip(signals, runs, strict=True))
        raise InputError(
            f"the clock was set back a different number of times in signals of one topic (runs {text}); record one run"
            " per bag"
        )
    merged = []
    for parts in zip(*runs, strict=True):
        stamp, first = np.unique(
            np.concatenate([one.stamp_ns[rows] for one, rows in zip(signals, parts, strict=True)]), return_index=True
        )
        receive = np.concatenate([one.receive_ns[rows] for one, rows in zip(signals, parts, strict=True)])[first]
        columns = np.full((len(signals), stamp.size), np.nan)
        for column, one, rows in zip(columns, signals, parts, strict=True):
            column[np.searchsorted(stamp, one.stamp_ns[rows])] = one.value[rows]
        merged.append((stamp, receive, columns))
    stamps, receives, tables = zip(*merged, strict=True)
    received = np.maximum.accumulate(np.concatenate(receives))
    return np.concatenate(stamps), received, list(np.concatenate(tables, axis=1))


def _value_findings(signals: list[Signal]) -> list[Finding]:
    found = []
    for signal in (one for one in signals if one.topic != CONDITIONS):
        command = signal.topic == "joint_command"
        found += missing_values(signal.name, signal.stamp_ns, signal.value, signal.name, command=command)
        if signal.doubtful:
            start, length = signal.doubtful[0]
            text = (
                f"{signal.name}: the number of turns is a guess in {counted(len(signal.doubtful), 'gap')} of the log"
                f" (the first at {start:.6g} s, {length:.4g} s long); cut the record there with `rows:`"
            )
            found.append(Finding("turns_unknown", text, len(signal.doubtful), signal.name, "warning"))
        if command and np.nanmax(signal.value) == np.nanmin(signal.value):
            text = (
                f"{signal.name} is constant ({np.nanmax(signal.value):g} {signal.unit}): nothing can be identified from"
                " this record alone, unless it begins with a step from rest"
            )
            found.append(Finding("constant_input", text, where=signal.name, level="warning"))
    if not any(signal.topic == "joint_command" for signal in signals):
        text = "no column or field is the command, so nothing can be fitted to this record; name one as `command:`"
        found.append(Finding("no_command", text, level="warning"))
    if not any(signal.topic == "joint_states" and signal.field in {"position", "velocity"} for signal in signals):
        text = (
            "neither a position nor a velocity is assigned, so no model can be fitted to this record or compared with"
            " it; add `position:` or `velocity:` to the mapping"
        )
        found.append(Finding("no_measurement", text, level="warning"))
    return found
