"""One recording of a robot as rows."""

from __future__ import annotations

import shutil
from dataclasses import replace

import fsspec
import numpy as np
import pytest

from benchmarks import fleet as simulated
from idloop import __version__
from idloop.fleet.bags import find_bags
from idloop.fleet.joint_day import FORCE_ERROR, Settings, identify_bag, joint_records, key_of
from idloop.physics import load_model
from idloop.records import Record, write_bag
from idloop.reporting.provenance import checksum


@pytest.fixture(scope="module")
def bag(recordings):
    return find_bags(str(recordings))[0]


@pytest.fixture(scope="module")
def rows(bag, settings):
    look, *found = identify_bag(bag, settings)
    assert (look["sha256"], "joint" in look) == (found[0]["sha256"], False)
    return found


def test_each_joint_is_identified_and_validated(rows, settings):
    by_name = {(one["joint"], one["parameter"]): one for one in rows}
    assert len(by_name) == 8
    for joint, kind in (("j0", "j0"), ("j1", "*")):
        model = dict(settings.kinds)[kind]
        for name in (simulated.NAMES["inertia"], simulated.NAMES["dry"]):
            found = by_name[joint, name]
            assert found["value"] == pytest.approx(model.values[name], rel=0.4)
            assert 0.0 < found["stderr"] < 0.05 * found["value"]
            assert found["kind"] == kind
        assert by_name[joint, FORCE_ERROR]["value"] == by_name[joint, FORCE_ERROR]["error_unseen"] < 0.1
    assert {one["reason"] for one in rows if "reason" in one} == set()


def test_every_row_says_where_it_comes_from(rows, bag, recordings, settings):
    digest = checksum(recordings / "robot000" / "2026-03-01")["sha256"]
    keys = ("sha256", "version", "seed", "robot", "bag")
    assert {tuple(one[key] for key in keys) for one in rows} == {(digest, __version__, 0, "robot000", bag.bag)}
    assert {(one["kind"], one["settings"]) for one in rows} == set(settings.digests.items())


def test_the_same_again_gives_the_same(rows, bag, settings):
    assert identify_bag(bag, settings)[1:] == rows


def test_what_is_done_by_its_checksum_is_not_done_again(rows, bag, recordings, settings, tmp_path):
    shutil.copytree(recordings / "robot000" / "2026-03-01", tmp_path / "moved")
    moved = replace(bag, bag=str(tmp_path / "moved"), stamp="other")
    (look,) = identify_bag(moved, settings, {key_of(one) for one in rows})
    assert identify_bag(moved, settings, {key_of(look)}) == [look]
    assert {one["joint"] for one in identify_bag(moved, settings, {key_of(rows[0])})[1:]} == {"j1"}
    assert len(identify_bag(replace(moved, robot="another"), settings, {key_of(one) for one in rows})) == 1 + len(rows)


def test_model_seed_and_name_are_a_part_of_what_is_done_with_a_joint(bag, settings):
    (one, base), (_, wrist) = settings.kinds
    others = [Settings(settings.kinds, seed=1), Settings(((one, wrist),)), Settings((("j*", base),))]
    jobs = {other.job(bag, "j0", other.kinds[0][0]) for other in (settings, *others)}
    assert len(jobs | {settings.job(bag, "j1", one), settings.job(replace(bag, robot="another"), "j0", one)}) == 6


def test_models_of_other_kinds_are_no_part_of_it(bag, settings):
    alone = Settings(settings.kinds[:1])
    assert alone.job(bag, "j0", "j0") == settings.job(bag, "j0", "j0")
    assert alone.look(bag) != settings.look(bag), "other joints may have a model now"


def test_a_broken_bag_costs_its_own_row(bag, recordings, settings, tmp_path):
    broken = tmp_path / "broken"
    shutil.copytree(recordings / "robot000" / "2026-03-01", broken)
    (file,) = broken.glob("*.mcap")
    file.write_bytes(file.read_bytes()[:20000])
    (row,) = identify_bag(replace(bag, bag=str(broken)), settings)
    assert "cut off" in row["reason"]
    assert row["robot"] == "robot000"
    (row,) = identify_bag(replace(bag, bag=str(tmp_path / "none")), settings)
    assert "no bag" in row["reason"]


def test_a_joint_that_cannot_be_identified_leaves_the_others(bag, settings):
    asked = (("j0", ""), ("nowhere", "j0"), ("j1", "unknown"))
    _, *found = identify_bag(replace(bag, joints=asked), settings)
    reasons = {one["joint"]: one.get("reason") for one in found}
    assert reasons["j0"] is None
    assert "nowhere" in reasons["nowhere"]
    assert "--joint" not in reasons["nowhere"], "an option of other verbs"
    assert "no model for one of kind unknown" in reasons["j1"]


def test_a_bag_at_an_address_is_fetched(rows, bag, recordings, settings):
    memory = fsspec.filesystem("memory")
    memory.put(str(recordings / "robot000" / "2026-03-01"), "/bags_of_test/one", recursive=True)
    _, *found = identify_bag(replace(bag, bag="memory://bags_of_test/one"), settings)
    assert [one["value"] for one in found] == [one["value"] for one in rows]
    memory.rm("/bags_of_test", recursive=True)


def test_of_a_recording_that_gaps_cut_the_part_in_which_nothing_moves_is_left_out(tmp_path):
    time = np.concatenate([np.arange(300), 5000 + np.arange(300)]) * 0.01
    motion = np.where(np.arange(600)[:, None] < 300, np.column_stack([np.sin(time), np.cos(time)]), 0.0)
    names, command = ("motor.position", "motor.velocity"), np.sign(np.sin(time / 0.07))
    whole = Record("bag", time, command, time, motion, "motor.effort", "V", names, ("rad", "rad/s"))
    write_bag(tmp_path / "bag", whole)
    (kept,) = joint_records(tmp_path / "bag", load_model("dc_motor"))
    assert kept.time.size == 300
    assert "nothing moves" in kept.findings[-1].text
