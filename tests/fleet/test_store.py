"""Results of a fleet in Parquet files."""

from __future__ import annotations

from dataclasses import replace
from datetime import datetime, timezone

import pytest

from idloop.errors import IdloopError
from idloop.fleet.bags import FleetBag
from idloop.fleet.joint_day import Settings
from idloop.fleet.store import Store


@pytest.fixture
def settings():
    return Settings(())


def row(bag: FleetBag, settings: Settings, sha: str | None, **more) -> dict:
    own = {"robot": bag.robot, "joint": "j", "kind": "k", "parameter": "p", "value": 1.0, "stderr": 0.1, "time": DAY}
    named = {"bag": bag.bag, "stamp": bag.stamp, "job": settings.job(bag), "settings": settings.digest, "sha256": sha}
    return {**own, **named, **more}


DAY = datetime(2026, 3, 1, tzinfo=timezone.utc)
ONE, TWO = FleetBag("r1", "one", stamp="10 100.0"), FleetBag("r2", "two", stamp="20 100.0")


def test_a_batch_is_written_once_and_whole(tmp_path, settings):
    store = Store(tmp_path)
    rows = [row(ONE, settings, "a"), row(TWO, settings, "b")]
    written = store.add(rows)
    before = written.read_bytes()
    assert store.add([{**one, "value": 9.0} for one in reversed(rows)]) == written
    assert written.read_bytes() == before
    assert [file.name for file in store.rows.iterdir()] == [written.name]


def test_what_is_there_is_left_out(tmp_path, settings):
    store = Store(tmp_path)
    assert store.done(settings).open([ONE, TWO], settings) == [(ONE, ()), (TWO, ())]
    store.add([row(ONE, settings, "a")])
    changed = replace(ONE, stamp="11 101.0")
    known = (f"a {settings.job(ONE)}",)
    assert store.done(settings).open([ONE, TWO, changed], settings) == [(TWO, ()), (changed, known)]
    other = Settings((), seed=1)
    assert store.done(other).open([ONE], other) == [(ONE, ())]


def test_a_bag_that_was_repaired_counts_as_it_is_now(tmp_path, settings):
    store = Store(tmp_path)
    store.add([row(ONE, settings, "broken", joint=None, parameter=None, value=None, reason="cut off")])
    assert store.counts([ONE], settings)[1][0]["reason"] == "cut off"
    repaired = replace(ONE, stamp="11 101.0")
    store.add([row(repaired, settings, "whole")])
    assert store.counts([repaired], settings) == (1, [])


def test_a_bag_that_was_put_back_counts_as_it_is_now(tmp_path, settings):
    """Its recording is known, and done again only where its state is not."""
    store, broken = Store(tmp_path), replace(ONE, stamp="9 101.0")
    store.add([row(ONE, settings, "whole")])
    store.add([row(broken, settings, "cut", joint=None, parameter=None, value=None, reason="cut off")])
    assert store.counts([broken], settings)[1][0]["reason"] == "cut off"
    # With the time of its first state.
    assert store.counts([ONE], settings) == (1, [])
    assert store.done(settings).open([ONE], settings) == []
    # With a new time.
    restored = replace(ONE, stamp="10 102.0")
    assert store.done(settings).open([restored], settings) == [(restored, (f"cut {settings.job(ONE)}",))]
    store.add([row(restored, settings, "whole")])
    assert store.counts([restored], settings) == (1, [])


def test_a_bag_counts_once_when_it_was_recovered(tmp_path, settings):
    store, recovered = Store(tmp_path), replace(ONE, bag="one_recovered", stamp="8 101.0", former="one")
    store.add([row(ONE, settings, "cut", joint=None, parameter=None, value=None, reason="cut off")])
    store.add([row(recovered, settings, "rest")])
    assert store.counts([recovered], settings) == (1, [])


def test_one_recording_under_two_names_counts_once(tmp_path, settings):
    store = Store(tmp_path)
    store.add([row(ONE, settings, "a")])
    store.add([row(replace(ONE, bag="copy", stamp="10 200.0"), settings, "a"), row(TWO, settings, "b")])
    (series,) = store.series([ONE, TWO], settings)
    assert series.names == (("r1", "j"), ("r2", "j"))
    assert series.value.tolist() == [[1.0], [1.0]]


def test_the_newest_recording_of_a_joint_is_named(tmp_path, settings):
    store, days = Store(tmp_path), [datetime(2026, 3, day, tzinfo=timezone.utc) for day in (1, 2)]
    bags = [replace(ONE, bag=f"b{day.day}", time=day) for day in days]
    store.add([row(one, settings, one.bag, time=one.time) for one in bags])
    (found,) = store.newest([("r1", "j")], bags, settings)
    assert found == {"robot": "r1", "joint": "j", "kind": "k", "bag": "b2", "sha256": "b2"}


def test_the_recordings_of_a_kind_come_joint_by_joint_with_their_estimates(tmp_path, settings):
    store, days = Store(tmp_path), [datetime(2026, 3, day, tzinfo=timezone.utc) for day in (2, 1)]
    bags = [replace(one, bag=f"{one.bag}{day.day}", time=day) for day in days for one in (TWO, ONE)]
    for one in bags:
        more = {"time": one.time, "error_fitted": 0.1, "force_residual": 2.0, "force_unit": "N", "seconds": 10.0}
        rows = [row(one, settings, one.bag, parameter=name, value=v, **more) for name, v in (("p", 1.0), ("q", 2.0))]
        store.add(
            [*rows, row(one, settings, one.bag, parameter="r", value=None), row(one, settings, None, kind="other")]
        )
    found = list(store.recordings(bags, settings, "k"))
    assert [(one.robot, one.bag) for one in found] == [("r1", "one1"), ("r1", "one2"), ("r2", "two1"), ("r2", "two2")]
    assert {name: one.estimates[name] for one in found for name in one.estimates} == {"p": (1.0, 0.1), "q": (2.0, 0.1)}
    assert found[0][4:9] == (0.1, 2.0, "N", 10.0, None)


def test_a_damaged_file_is_one_line(tmp_path, settings):
    store = Store(tmp_path)
    store.rows.mkdir()
    (store.rows / "x.parquet").write_text("no table")
    with pytest.raises(IdloopError, match=r"x\.parquet"):
        store.done(settings)
