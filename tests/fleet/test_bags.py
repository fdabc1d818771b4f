"""Bags of a fleet: from a folder, a pattern, a table, and at an address."""

from __future__ import annotations

import sys
from datetime import datetime, timezone
from pathlib import Path

import fsspec
import pyarrow as pa
import pytest
from fsspec.implementations.memory import MemoryFileSystem
from pyarrow import parquet

from idloop.errors import InputError
from idloop.fleet import bags
from idloop.fleet.bags import find_bags

MARCH = datetime(2026, 3, 1, tzinfo=timezone.utc)


@pytest.fixture
def folder(tmp_path):
    for name in ("r2/2026-03-01/run", "r1/20260301_140500", "r1/2026-03-02"):
        (tmp_path / name).mkdir(parents=True)
        (tmp_path / name / "metadata.yaml").write_text("a")
        (tmp_path / name / "run_0.mcap").write_text("b")
    (tmp_path / "r3").mkdir()
    (tmp_path / "r3" / "2026-03-05.mcap").write_text("cc")
    (tmp_path / "r3" / "notes.txt").write_text("not a bag")
    return tmp_path


def test_a_folder_gives_robot_and_date_of_every_bag(folder):
    found = [(one.robot, Path(one.bag).relative_to(folder).as_posix(), one.time) for one in find_bags(str(folder))]
    assert found == [
        ("r1", "r1/20260301_140500", MARCH.replace(hour=14, minute=5)),
        ("r1", "r1/2026-03-02", MARCH.replace(day=2)),
        ("r2", "r2/2026-03-01/run", MARCH),
        ("r3", "r3/2026-03-05.mcap", MARCH.replace(day=5)),
    ]


def test_a_pattern_takes_a_part_of_it(folder):
    found = find_bags(f"{folder}/r*/2026-03-0[12]*")
    assert [(one.robot, one.time) for one in found] == [("r1", MARCH.replace(day=2)), ("r2", MARCH)]


def test_what_was_recovered_takes_the_place_of_its_bag(folder):
    for name in ("r3/2026-03-05_recovered", "r2/2026-03-01/run_recovered"):
        (folder / name).mkdir()
        (folder / name / "metadata.yaml").write_text("a")
    assert [Path(one.bag).relative_to(folder).as_posix() for one in find_bags(str(folder))] == [
        "r1/20260301_140500", "r1/2026-03-02", "r2/2026-03-01/run_recovered", "r3/2026-03-05_recovered",
    ]  # fmt: skip


def test_a_stamp_changes_with_the_bag(folder):
    before = {one.bag: one.stamp for one in find_bags(str(folder))}
    (folder / "r3" / "2026-03-05.mcap").write_text("longer")
    after = {one.bag: one.stamp for one in find_bags(str(folder))}
    assert {bag for bag in before if before[bag] != after[bag]} == {str(folder / "r3" / "2026-03-05.mcap")}


@pytest.mark.parametrize("form", ["csv", "parquet"])
def test_the_joints_of_a_bag_are_rows_of_a_table(folder, form):
    table = folder / f"table.{form}"
    rows = [("7", "elbow", "2026-03-01", "r1/2026-03-02", "arm"), ("7", "wrist", "2026-03-01", "r1/2026-03-02", "hand")]
    if form == "csv":
        table.write_text("robot,joint,time,bag,kind\n" + "\n".join(map(",".join, rows)) + "\n")
    else:
        columns = dict(zip(("robot", "joint", "time", "bag", "kind"), zip(*rows, strict=True), strict=True))
        parquet.write_table(pa.table({key: list(values) for key, values in columns.items()}), table)
    (one,) = find_bags(str(table))
    assert (one.robot, one.time, one.bag) == ("7", MARCH, str(folder / "r1/2026-03-02"))
    assert one.joints == (("elbow", "arm"), ("wrist", "hand"))
    assert one.stamp


def test_a_missing_bag_of_a_table_is_no_error(folder):
    (folder / "t.csv").write_text("robot,joint,time,bag\nr9,j,2026-03-01,r9/none\n")
    (one,) = find_bags(str(folder / "t.csv"))
    assert (one.robot, one.stamp) == ("r9", "")


def test_an_address_is_another_file_system(folder):
    memory = fsspec.filesystem("memory")
    memory.put(str(folder / "r1"), "/fleet_of_test/r1", recursive=True)
    found = find_bags("memory://fleet_of_test")
    assert [(one.robot, one.bag) for one in found] == [
        ("r1", "memory:///fleet_of_test/r1/20260301_140500"),
        ("r1", "memory:///fleet_of_test/r1/2026-03-02"),
    ]
    memory.rm("/fleet_of_test", recursive=True)


class Remembering(MemoryFileSystem):
    """Lists a place once, as those of clouds do."""

    protocol = "remembering"

    @classmethod
    def _strip_protocol(cls, path):
        return super()._strip_protocol(path.removeprefix("remembering://"))

    def find(self, path, **options):
        return self.dircache.setdefault(path, super().find(path, **options))

    def invalidate_cache(self, path=None):
        self.dircache.clear()


def test_what_has_come_since_the_last_look_is_seen(folder):
    fsspec.register_implementation("remembering", Remembering, clobber=True)
    memory = fsspec.filesystem("memory")
    memory.put(str(folder / "r1"), "/watched/r1", recursive=True)
    before = find_bags("remembering://watched")
    memory.put(str(folder / "r2"), "/watched/r2", recursive=True)
    assert (len(before), len(find_bags("remembering://watched"))) == (2, 3)
    memory.rm("/watched", recursive=True)


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("robot,joint,time\nr,j,2026-03-01\n", "no column bag"),
        ("robot,joint,time,bag\nr,j,soon,b\n", "row 1: time 'soon'"),
        ("robot,joint,time,bag\n,j,2026-03-01,b\n", "row 1: no robot"),
        ("robot,joint,time,bag,kind\nr,,2026-03-01,b,arm\n", "kind 'arm' without a joint"),
        ("", "cannot be read as a table"),
    ],
)
def test_a_bad_table_is_one_line(tmp_path, text, line):
    (tmp_path / "t.csv").write_text(text)
    with pytest.raises(InputError, match=line):
        find_bags(str(tmp_path / "t.csv"))


def test_a_table_is_read_from_memory_of_arrow(folder, monkeypatch):
    """A thread of Arrow that releases an object of Python at exit ends the process by an abort."""
    parquet.write_table(pa.table({"robot": ["r"], "joint": ["j"], "time": [""], "path": ["b"]}), folder / "t.parquet")
    given = []

    def read(source):
        given.append(source)
        return table(source)

    table = parquet.read_table
    monkeypatch.setattr(parquet, "read_table", read)
    with pytest.raises(InputError, match="no column bag"):
        find_bags(str(folder / "t.parquet"))
    assert type(given[0]) is pa.BufferReader


def test_nothing_is_imported_to_refuse_a_place_that_is_not_there(tmp_path, monkeypatch):
    monkeypatch.setattr(bags, "library", None)
    for place in ("none", "none/*", "none.csv"):
        with pytest.raises(InputError, match="no such table or folder"):
            find_bags(str(tmp_path / place))


def test_no_bag_is_one_line(tmp_path):
    with pytest.raises(InputError, match="there is no bag"):
        find_bags(str(tmp_path))
    assert find_bags(str(tmp_path), empty=True) == []
    with pytest.raises(InputError, match="no such table or folder"):
        find_bags(str(tmp_path / "none"))
    with pytest.raises(InputError, match="nowhere"):
        find_bags("nowhere://robots")


def test_an_address_without_its_library_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "s3fs", None)
    with pytest.raises(InputError, match=r"s3://robots/t\.csv: .*s3.*: pip install s3fs$"):
        find_bags("s3://robots/t.csv")
    with pytest.raises(InputError, match="Protocol not known: nowhere"):
        find_bags("nowhere://robots")
