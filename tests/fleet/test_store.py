"""Results of a fleet in Parquet files."""

from __future__ import annotations

from dataclasses import replace
from datetime import datetime, timezone

import pytest

from idloop.errors import IdloopError
from idloop.fleet.bags import FleetBag
from idloop.fleet.joint_day import Settings
from idloop.fleet.store import Store
from idloop.physics import load_model


@pytest.fixture(scope="module")
def settings():
    return Settings((("k", load_model("axis")),))


def look(bag: FleetBag, settings: Settings, sha: str | None, reason: str | None = None) -> dict:
    """Row of a look at a bag."""
    named = {"robot": bag.robot, "bag": bag.bag, "stamp": bag.stamp, "settings": settings.digest, "sha256": sha}
    return {**named, "job": settings.look(bag), "reason": reason}


def row(bag: FleetBag, settings: Settings, sha: str | None, kind: str = "k", **more) -> dict:
    """Row of a parameter of a joint."""
    own = {"joint": "j", "kind": kind, "parameter": "p", "value": 1.0, "stderr": 0.1, "time": bag.time or DAY}
    made = {"job": settings.job(bag, "j", kind), "settings": settings.digests[kind]}
    return {**look(bag, settings, sha), **own, **made, **more}


def both(bag: FleetBag, settings: Settings, sha: str) -> list[dict]:
    """Rows of a bag with one parameter of one joint."""
    return [look(bag, settings, sha), row(bag, settings, sha)]


DAY = datetime(2026, 3, 1, tzinfo=timezone.utc)
J = (("j", "k"),)
ONE, TWO = (FleetBag(f"r{k}", name, None, J, f"{k}0 100.0") for k, name in ((1, "one"), (2, "two")))


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
    store.add(both(ONE, settings, "a"))
    changed = replace(ONE, stamp="11 101.0")
    known = (f"a {settings.look(ONE)}", f"a {settings.job(ONE, 'j', 'k')}")
    assert store.done(settings).open([ONE, TWO, changed], settings) == [(TWO, ()), (changed, known)]
    other = Settings(settings.kinds, seed=1)
    assert store.done(other).open([ONE], other) == [(ONE, ())]


@pytest.mark.parametrize("stated", [True, False])
def test_a_new_kind_leaves_what_is_done_of_the_others(tmp_path, settings, stated):
    """It is looked for in every bag that may have a joint of it."""
    store, bag = Store(tmp_path), ONE if stated else replace(ONE, joints=())
    settings = settings if stated else Settings((("j", settings.kinds[0][1]),))
    kind = settings.kinds[0][0]
    store.add([look(bag, settings, "a"), row(bag, settings, "a", kind)])
    more = Settings((*settings.kinds, ("new", settings.kinds[0][1])))
    known = (f"a {settings.job(bag, 'j', kind)}",)
    assert store.done(more).open([bag], more) == [(bag, known)]
    store.add([look(bag, more, "a")])
    assert store.done(more).open([bag], more) == []
    assert store.counts([bag], more) == store.counts([bag], settings) == (1, [])
    assert [one.kind for one in store.series([bag], more)] == [kind]
    other = Settings(((kind, load_model("dc_motor")),))
    assert store.counts([bag], other) == (0, []), "of another model of this kind there is nothing"


def test_a_bag_that_was_repaired_counts_as_it_is_now(tmp_path, settings):
    store = Store(tmp_path)
    store.add([look(ONE, settings, "broken", "cut off")])
    assert store.counts([ONE], settings)[1][0]["reason"] == "cut off"
    repaired = replace(ONE, stamp="11 101.0")
    store.add(both(repaired, settings, "whole"))
    assert store.counts([repaired], settings) == (1, [])


def test_a_bag_under_which_workers_ended_is_done_again(tmp_path, settings):
    store = Store(tmp_path)
    store.add([look(replace(ONE, stamp=""), settings, None, "worker ended")])
    assert store.counts([ONE], settings)[1][0]["reason"] == "worker ended"
    assert store.done(settings).open([ONE], settings) == [(ONE, ())]
    store.add(both(ONE, settings, "a"))
    assert store.counts([ONE], settings) == (1, [])


def test_a_bag_that_was_put_back_counts_as_it_is_now(tmp_path, settings):
    """What is known of its content is not done again."""
    store, broken = Store(tmp_path), replace(ONE, stamp="9 101.0")
    store.add(both(ONE, settings, "whole"))
    store.add([look(broken, settings, "cut", "cut off")])
    assert store.counts([broken], settings)[1][0]["reason"] == "cut off"
    # With the time of its first state.
    assert store.counts([ONE], settings) == (1, [])
    assert store.done(settings).open([ONE], settings) == []
    # With a new time.
    restored = replace(ONE, stamp="10 102.0")
    known = (f"whole {settings.look(ONE)}", f"whole {settings.job(ONE, 'j', 'k')}")
    assert store.done(settings).open([restored], settings) == [(restored, known)]
    store.add([look(restored, settings, "whole")])
    assert store.counts([restored], settings) == (1, [])
    assert store.done(settings).open([restored], settings) == []


def test_a_bag_counts_once_when_it_was_recovered(tmp_path, settings):
    store, recovered = Store(tmp_path), replace(ONE, bag="one_recovered", stamp="8 101.0")
    store.add([look(ONE, settings, "cut", "cut off")])
    store.add(both(recovered, settings, "rest"))
    assert store.counts([recovered], settings) == (1, [])


def test_a_bag_that_was_deleted_or_moved_counts_where_it_is_now(tmp_path, settings):
    store, moved = Store(tmp_path), replace(ONE, bag="moved")
    store.add(both(ONE, settings, "a"))
    assert store.counts([TWO], settings) == (0, [])
    store.add([look(moved, settings, "a")])
    (found,) = store.newest([("r1", "j")], [moved], settings)
    assert found["bag"] == "moved"


def test_one_recording_under_two_names_counts_once(tmp_path, settings):
    store, copy = Store(tmp_path), replace(ONE, bag="copy", stamp="10 200.0")
    store.add(both(ONE, settings, "a"))
    store.add([*both(copy, settings, "a"), *both(TWO, settings, "b")])
    (series,) = store.series([ONE, copy, TWO], settings)
    assert series.names == (("r1", "j"), ("r2", "j"))
    assert series.value.tolist() == [[1.0], [1.0]]
    assert store.counts([ONE, copy, TWO], settings) == (2, [])


def test_the_newest_recording_of_a_joint_is_named(tmp_path, settings):
    store, days = Store(tmp_path), [datetime(2026, 3, day, tzinfo=timezone.utc) for day in (1, 2)]
    bags = [replace(ONE, bag=f"b{day.day}", time=day) for day in days]
    store.add([line for one in bags for line in both(one, settings, one.bag)])
    (found,) = store.newest([("r1", "j")], bags, settings)
    assert found == {"robot": "r1", "joint": "j", "kind": "k", "bag": "b2", "sha256": "b2"}


def test_the_recordings_of_a_kind_come_joint_by_joint_with_their_estimates(tmp_path, settings):
    store, days = Store(tmp_path), [datetime(2026, 3, day, tzinfo=timezone.utc) for day in (2, 1)]
    bags = [replace(one, bag=f"{one.bag}{day.day}", time=day) for day in days for one in (TWO, ONE)]
    for one in bags:
        more = {"error_fitted": 0.1, "force_residual": 2.0, "force_unit": "N", "seconds": 10.0}
        values = (("p", 1.0), ("q", 2.0), ("r", None))
        rows = [row(one, settings, one.bag, parameter=name, value=value, **more) for name, value in values]
        store.add([look(one, settings, one.bag), *rows])
    assert list(store.recordings(bags, settings, "other")) == []
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
