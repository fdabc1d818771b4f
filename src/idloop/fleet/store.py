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
    """What a folder of results has of some settings."""

    keys: frozenset[str] = frozenset()  # see `key_of`: of the joints, and of the looks at recordings that could be read
    looks: frozenset[tuple[str, str, str]] = frozenset()  # bag, stamp and look
    joints: tuple[str, ...] = ()  # names of all joints

    def open(self, bags: Iterable[FleetBag], settings: Settings) -> list[tuple[FleetBag, tuple[str, ...]]]:
        """Bags that are new, have changed, or may have joints of a new model, each with the keys of what is done of it.

        One that is still missing is not among them.
        """
        by_job: dict[str, list[str]] = {}
        for key in self.keys:
            by_job.setdefault(key.rpartition(" ")[2], []).append(key)
        return [
            (one, tuple(key for job in (look, *settings.jobs(one, self.joints)) for key in by_job.get(job, ())))
            for one in bags
            if (one.bag, one.stamp, look := settings.look(one)) not in self.looks
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
    """A folder of results."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.rows = folder / ROWS

    @property
    def pattern(self) -> str:
        """Pattern of the Parquet files."""
        return str(self.rows / "*.parquet")

    def done(self, settings: Settings) -> Done:
        """Return what is there of these settings."""
        sql = """select distinct bag, sha256, coalesce(stamp, '') as stamp, job, joint, joint is null and reason is not
            null as failed from rows where settings in (select unnest(?))"""
        found = as_rows(self.query(sql, [[settings.digest, *settings.digests.values()]]))
        keys = frozenset(key_of(one) for one in found if not one["failed"])
        looks = frozenset((one["bag"], one["stamp"], one["job"]) for one in found if one["joint"] is None)
        return Done(keys, looks, tuple({one["joint"]: None for one in found if one["joint"] is not None}))

    def query(self, sql: str, values: Sequence[Any] = ()) -> Any:
        """Answer a question in SQL, in which ``rows`` is all that is there.

        Raises IdloopError: a file of the folder cannot be read.
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
        keys = "\n".join(sorted({f"{key_of(dict(one))} {one.get('stamp')} {one['bag']}" for one in rows}))
        target = self.rows / f"{hashlib.sha256(keys.encode()).hexdigest()[:24]}.parquet"
        if not target.exists():
            write_table(target, rows, COLUMNS)
        return target

    def chosen(self, bags: Sequence[FleetBag], settings: Settings, what: str, more: Sequence[Any] = ()) -> Any:
        """Answer a question about ``chosen``: of these bags as they are now, and these settings, each joint once.

        The look at a bag in its present state has its checksum, which has the joints; of one under which workers ended
        there is a look without a state. One recording under two names counts once.
        """
        (names,) = self.query("select coalesce(list(distinct joint), []) from rows where joint is not null").fetchone()
        head = """
            with asked as (select unnest(?) as bag, unnest(?) as stamp, unnest(?) as job),
            wanted as (select unnest(?) as bag, unnest(?) as job),
            looks as (
                select rows.* from rows join asked using (bag, job)
                where joint is null and coalesce(rows.stamp, '') in (asked.stamp, '')
                qualify row_number() over (
                    partition by bag, job order by coalesce(rows.stamp, '') = '', reason nulls first) = 1),
            held as (select looks.bag, looks.sha256, wanted.job from looks join wanted using (bag)),
            chosen as (
                select * from looks where reason is not null union all by name
                select rows.* replace (held.bag as bag) from rows join held using (sha256, job)
                qualify row_number() over (partition by sha256, job, parameter order by held.bag, rows.bag) = 1)"""
        asked = list(zip(*((one.bag, one.stamp, settings.look(one)) for one in bags), strict=True)) or [()] * 3
        pairs = ((one.bag, job) for one in bags for job in settings.jobs(one, names))
        wanted = list(zip(*pairs, strict=True)) or [()] * 2
        return self.query(head + what, [*map(list, (*asked, *wanted)), *more])

    def series(self, bags: Sequence[FleetBag], settings: Settings) -> Iterator[Series]:
        """Yield every parameter of every kind."""
        what = """
            select kind, parameter, any_value(unit), list(robot order by time, bag), list(joint order by time, bag),
                list(epoch(time) / 86400 order by time, bag), list(value order by time, bag),
                list(stderr order by time, bag)
            from chosen where value is not null group by kind, parameter order by kind, parameter"""
        answer = self.chosen(bags, settings, what)
        least = {(kind, one.name): one.min for kind, model in settings.kinds for one in model.parameters}
        while row := answer.fetchone():
            kind, parameter, unit, robots, joints, *numbers = row
            days, value, stderr = (np.array(one, dtype=float) for one in numbers)
            names, bound = list(zip(robots, joints, strict=True)), least.get((kind, parameter), -np.inf)
            yield series_of(kind, parameter, unit, names, days, value, stderr, bound)

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
        identified = "select count(distinct (sha256, job)) from chosen where parameter is not null"
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
