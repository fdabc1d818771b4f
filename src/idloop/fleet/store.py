"""The results of a fleet as a folder of Parquet files: one for each finished batch, none ever written again."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from idloop.errors import IdloopError
from idloop.fleet.bags import FleetBag
from idloop.fleet.joint_day import Settings, key_of
from idloop.fleet.libraries import library
from idloop.fleet.statistics import Series, series_of
from idloop.output_files import make_folder, writing

ROWS, JOINTS, MODELS = "rows", "joints", "models"
# Columns, and their types in Parquet.
COLUMNS = {
    "robot": "string", "joint": "string", "kind": "string", "time": "timestamp", "bag": "string",
    "parameter": "string", "value": "double", "stderr": "double", "unit": "string", "error_fitted": "double",
    "error_unseen": "double", "force_residual": "double", "force_unit": "string", "seconds": "double",
    "samples": "int64", "reason": "string", "notes": "string", "sha256": "string", "stamp": "string", "job": "string",
    "settings": "string", "version": "string", "seed": "int64",
}  # fmt: skip


@dataclass(frozen=True)
class Done:
    """What a folder of results has of some settings.

    Attributes
    ----------
    keys : frozenset of str
        See `key_of`.
    stamps : frozenset of (str, str, str)
        Bag, stamp and job.
    former : frozenset of (str, str)
        Bag, and the key of an earlier state of it.
    """

    keys: frozenset[str] = frozenset()
    stamps: frozenset[tuple[str, str, str]] = frozenset()
    former: frozenset[tuple[str, str]] = frozenset()

    def open(self, bags: Iterable[FleetBag], settings: Settings) -> list[tuple[FleetBag, tuple[str, ...]]]:
        """Bags that are new or have changed, each with the keys of its job that are done: it may have been moved.

        One that is still missing is neither. What a bag was before it changed is not done: it may have been put back.
        """
        by_job: dict[str, list[str]] = {}
        for key in self.keys:
            by_job.setdefault(key.rpartition(" ")[2], []).append(key)
        jobs = ((one, settings.job(one)) for one in bags)
        return [
            (one, tuple(key for key in by_job.get(job, ()) if (one.bag, key) not in self.former))
            for one, job in jobs
            if (one.bag, one.stamp, job) not in self.stamps
        ]


class Recording(NamedTuple):
    """What was identified of a joint in one recording: `estimates` are values and standard errors by parameter."""

    robot: str
    joint: str
    time: datetime
    bag: str
    error_fitted: float | None
    force_residual: float | None
    force_unit: str | None
    seconds: float | None
    notes: str | None
    estimates: dict[str, tuple[float, float | None]]


class Store:
    """A folder of results.

    Parameters
    ----------
    folder : Path
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.rows = folder / ROWS

    @property
    def pattern(self) -> str:
        """Pattern of the Parquet files."""
        return str(self.rows / "*.parquet")

    def done(self, settings: Settings) -> Done:
        """Return what is there of these settings."""
        found = as_rows(
            self.query("select distinct bag, sha256, stamp, job from rows where settings = ?", [settings.digest])
        )
        keys = frozenset(key_of(one) for one in found)
        stamps = frozenset((one["bag"], one["stamp"] or "", one["job"]) for one in found)
        newest: dict[tuple[str, str], str] = {}
        for one in sorted(found, key=lambda one: (one["stamp"] or "").partition(" ")[2]):
            newest[one["bag"], one["job"]] = key_of(one)
        former = {(one["bag"], key_of(one)) for one in found if key_of(one) != newest[one["bag"], one["job"]]}
        return Done(keys, stamps, frozenset(former))

    def query(self, sql: str, values: Sequence[Any] = ()) -> Any:
        """Answer a question in SQL, in which ``rows`` is all that is there.

        Raises
        ------
        IdloopError
            A file of the folder cannot be read.
        """
        duckdb = library("duckdb")
        try:
            connection = duckdb.connect()
            connection.execute("set timezone = 'UTC'")
            if any(self.rows.glob("*.parquet")):
                connection.execute(f"create view rows as from read_parquet({quoted(self.pattern)})")
            else:
                types = {"timestamp": "timestamptz", "string": "varchar", "int64": "bigint"}
                columns = ", ".join(f"{name} {types.get(kind, kind)}" for name, kind in COLUMNS.items())
                connection.execute(f"create table rows ({columns})")
            return connection.execute(sql, list(values))
        except duckdb.Error as error:
            raise IdloopError(f"{self.rows}: {' '.join(str(error).split())}") from error

    def add(self, rows: Sequence[Mapping[str, Any]]) -> Path:
        """Write a finished batch: under a temporary name first, so that a file is whole or is not there.

        The name follows from what was done: the same batch is written once.
        """
        make_folder(self.rows, parents=True)
        keys = "\n".join(sorted({f"{key_of(dict(one))} {one.get('stamp')}" for one in rows}))
        target = self.rows / f"{hashlib.sha256(keys.encode()).hexdigest()[:24]}.parquet"
        if not target.exists():
            write_table(target, rows, COLUMNS)
        return target

    def chosen(self, bags: Sequence[FleetBag], settings: Settings, what: str, more: Sequence[Any] = ()) -> Any:
        """Answer a question about ``chosen``: of these bags and settings each joint and recording once.

        Of a bag that has changed its present state counts, or the newest; one recording under two names counts once,
        and one that was recovered in the place of what it was.
        """
        jobs = sorted({settings.job(one) for one in bags})
        head = """
            with newest as (
                select * from rows where settings = ? and job in (select unnest(?)) and bag not in (select unnest(?))
                qualify dense_rank() over (partition by bag, job order by
                    (bag || ' ' || coalesce(stamp, '')) in (select unnest(?)) desc,
                    split_part(stamp, ' ', 2) desc) = 1),
            chosen as (
                select * from newest qualify row_number() over (
                    partition by coalesce(sha256, bag), job, joint, parameter order by bag) = 1)"""
        present = [f"{one.bag} {one.stamp}" for one in bags]
        former = [one.former for one in bags]
        return self.query(head + what, [settings.digest, jobs, former, present, *more])

    def series(self, bags: Sequence[FleetBag], settings: Settings) -> Iterator[Series]:
        """Yield every parameter of every kind."""
        what = """
            select kind, parameter, any_value(unit), list(robot order by time, bag), list(joint order by time, bag),
                list(epoch(time) / 86400 order by time, bag), list(value order by time, bag),
                list(stderr order by time, bag)
            from chosen where value is not null group by kind, parameter order by kind, parameter"""
        answer = self.chosen(bags, settings, what)
        while row := answer.fetchone():
            kind, parameter, unit, robots, joints, *numbers = row
            days, value, stderr = (np.array(one, dtype=float) for one in numbers)
            yield series_of(kind, parameter, unit, list(zip(robots, joints, strict=True)), days, value, stderr)

    def recordings(self, bags: Sequence[FleetBag], settings: Settings, kind: str) -> Iterator[Recording]:
        """Yield every recording of every joint of a kind, each joint's in the order of time."""
        what = """
            select robot, joint, time, bag, any_value(error_fitted), any_value(force_residual), any_value(force_unit),
                any_value(seconds), any_value(notes), list(parameter), list(value), list(stderr)
            from chosen where value is not null and kind = ?
            group by robot, joint, time, bag order by robot, joint, time, bag"""
        answer = self.chosen(bags, settings, what, [kind])
        while row := answer.fetchone():
            *given, names, values, errors = row
            yield Recording._make([*given, dict(zip(names, zip(values, errors, strict=True), strict=True))])

    def counts(self, bags: Sequence[FleetBag], settings: Settings) -> tuple[int, list[dict[str, Any]]]:
        """Joints and recordings that were identified, and rows of what could not be."""
        identified = "select count(distinct (sha256, job, joint)) from chosen where parameter is not null"
        failed = "select robot, joint, time, bag, reason from chosen where reason is not null order by all"
        (count,) = self.chosen(bags, settings, identified).fetchone()
        return count, as_rows(self.chosen(bags, settings, failed))

    def newest(
        self, joints: Sequence[tuple[str, str]], bags: Sequence[FleetBag], settings: Settings
    ) -> list[dict[str, Any]]:
        """Newest recording of some robots' joints, in their order: robot, joint, kind, bag, sha256."""
        what = """
            select robot, joint, kind, bag, sha256 from chosen where parameter is not null
            and (robot, joint) in (select unnest(?), unnest(?))
            qualify row_number() over (partition by robot, joint order by time desc, bag, parameter) = 1"""
        robots, names = [one for one, _ in joints], [one for _, one in joints]
        found = as_rows(self.chosen(bags, settings, what, [robots, names]))
        return sorted(found, key=lambda one: joints.index((one["robot"], one["joint"])))


def quoted(text: str) -> str:
    """Write a text as a literal of SQL."""
    return "'" + text.replace("'", "''") + "'"


def as_rows(answer: Any) -> list[dict[str, Any]]:
    """Rows of an answer."""
    names = [one[0] for one in answer.description]
    return [dict(zip(names, row, strict=True)) for row in answer.fetchall()]


def write_table(target: Path, rows: Sequence[Mapping[str, Any]], columns: Mapping[str, str]) -> None:
    """Write rows as one Parquet file, which replaces what is there at once."""
    library("pyarrow.parquet")
    import pyarrow as pa
    from pyarrow import parquet

    types = {"string": pa.string(), "double": pa.float64(), "int64": pa.int64(),
             "timestamp": pa.timestamp("us", tz="UTC")}  # fmt: skip
    schema = pa.schema([(name, types[kind]) for name, kind in columns.items()])
    table = pa.Table.from_pylist([{name: one.get(name) for name in columns} for one in rows], schema=schema)
    unfinished = target.with_name(f".{target.name}.{os.getpid()}")
    with writing(target):
        parquet.write_table(table, unfinished, compression="zstd")
        unfinished.replace(target)
