"""A whole fleet by the API: resumable, incremental, idempotent, with page, document and figure."""

from __future__ import annotations

import json
import os
import shutil
import threading
from dataclasses import replace

import numpy as np
import pytest

import idloop
from benchmarks import fleet as simulated
from idloop.api import fleet
from idloop.api.fleet import _found_and_left
from idloop.errors import InputError
from idloop.fleet.bags import FleetBag
from idloop.fleet.joint_day import FORCE_ERROR
from idloop.fleet.statistics import Finding, Series, take_apart
from idloop.fleet.store import Store
from idloop.physics.model_file import from_text

pytest.importorskip("distributed")
pytest.importorskip("duckdb")
parquet = pytest.importorskip("pyarrow.parquet")

MODELS = {"j0": from_text(simulated.KINDS["base"], None), "j1": from_text(simulated.KINDS["wrist"], None)}
BAGS, JOINTS = 4, 2


@pytest.fixture(scope="module")
def bags(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bags")
    plan = simulated.Fleet(2, JOINTS, 2, missing=0.0, broken=0.0)
    for robot in range(plan.robots):
        simulated.write_robot(folder, plan, robot)
    return folder


@pytest.fixture(scope="module")
def first(bags, tmp_path_factory):
    folder = tmp_path_factory.mktemp("results")
    found = idloop.identify_fleet(bags, MODELS, folder, workers=0, diagnose=0)
    found.save()
    return found


def files(folder):
    return {file.name: file.read_bytes() for file in (folder / "rows").iterdir()}


def again(first, bags, **options):
    return idloop.identify_fleet(bags, MODELS, first.folder, workers=0, diagnose=0, **options)


def test_every_recording_is_identified(first):
    assert (first.bags, first.new, first.joint_days, first.failed) == (BAGS, BAGS, BAGS * JOINTS, ())
    assert {one.series.kind for one in first.components} == set(MODELS)


def test_the_same_again_does_nothing_and_changes_nothing(first, bags):
    before, document = files(first.folder), first.to_dict()
    found = again(first, bags)
    assert found.new == 0
    assert files(first.folder) == before
    assert found.to_dict() == document | {"new": 0}


def test_only_what_is_new_is_done(first, bags, tmp_path):
    shutil.copytree(bags, tmp_path / "bags")
    shutil.copytree(first.folder, tmp_path / "results")
    before = files(tmp_path / "results")
    plan = simulated.Fleet(2, JOINTS, 3, missing=0.0, broken=0.0)
    simulated.write_robot(tmp_path / "bags", plan, 0, range(2, 3))
    found = idloop.identify_fleet(tmp_path / "bags", MODELS, tmp_path / "results", workers=0, diagnose=0)
    # The copies have other paths and times: their checksums are those of recordings that are done.
    assert (found.bags, found.new, found.joint_days) == (BAGS + 1, 1, (BAGS + 1) * JOINTS)
    after = files(tmp_path / "results")
    assert {name: after[name] for name in before} == before


def test_another_kind_leaves_the_joints_that_are_done(bags, tmp_path):
    one, both = dict([*MODELS.items()][:1]), MODELS
    for models, new, rows in ((one, BAGS, 4), (both, BAGS, 8), (both, 0, 8), (one, 0, 8)):
        found = idloop.identify_fleet(bags, models, tmp_path, workers=0, diagnose=0)
        sql = "select count(*), count(distinct (sha256, joint, parameter)) from rows where parameter is not null"
        assert (found.new, found.joint_days) == (new, BAGS * len(models))
        assert Store(tmp_path).query(sql).fetchone() == (BAGS * rows, BAGS * rows)


def test_a_broken_bag_is_one_line_of_the_answer(first, bags, tmp_path):
    shutil.copytree(bags / "robot000", tmp_path / "bags" / "robot000")
    (tmp_path / "bags" / "robot000" / "2026-03-09.mcap").write_bytes(b"not a bag")
    found = idloop.identify_fleet(tmp_path / "bags", MODELS, tmp_path / "out", workers=0, diagnose=0)
    assert found.joint_days == 2 * JOINTS
    (failed,) = found.failed
    assert failed["bag"].endswith("2026-03-09.mcap")
    assert "2026-03-09.mcap" in found.summary()


def test_a_bag_that_is_put_back_after_it_was_cut_off_counts_again(bags, tmp_path):
    shutil.copytree(bags / "robot000", tmp_path / "bags" / "robot000")
    bag = max((tmp_path / "bags").rglob("*.mcap"))
    whole = bag.read_bytes()
    counts = []
    for step, content in enumerate((whole, b"cut off", whole, b"cut off", whole)):
        bag.write_bytes(content)
        os.utime(bag, (2e9 + step, 2e9 + step))
        found = idloop.identify_fleet(tmp_path / "bags", MODELS, tmp_path / "out", workers=0, diagnose=0)
        counts.append((len(found.failed), found.joint_days))
    (_, all_days), (_, less) = counts[:2]
    assert counts == [(0, all_days), (1, less), (0, all_days), (1, less), (0, all_days)]


def test_a_recording_under_which_workers_ended_is_tried_again(bags, tmp_path, monkeypatch):
    def lose(self, function, items, *shared, size, lost):
        yield from (([one], [lost(one)]) for one in items)

    with monkeypatch.context() as patch:
        patch.setattr("idloop.fleet.engine.Workers.map", lose)
        found = idloop.identify_fleet(bags / "robot000", MODELS, tmp_path, workers=0, diagnose=0)
        assert [("--memory" in one["reason"]) for one in found.failed] == [True, True]
        assert idloop.identify_fleet(bags / "robot000", MODELS, tmp_path, workers=0, diagnose=0).failed == found.failed
    found = idloop.identify_fleet(bags / "robot000", MODELS, tmp_path, workers=0, diagnose=0)
    assert (found.joint_days, found.failed) == (2 * JOINTS, ())


def test_results_are_written_for_sql_and_for_readers(first):
    document = json.loads((first.folder / "fleet.json").read_text(encoding="utf-8"))
    assert document["schema"] == "idloop/fleet/1"
    assert document == json.loads(json.dumps(first.to_dict())) | {"plot": None}
    assert document["misfits"] == []
    assert [one.partition(":")[0] for one in document["untested"]] == ["not tested for j0, j1"] * 2
    page = (first.folder / "fleet.html").read_text(encoding="utf-8")
    assert "default-src 'none'" in page
    for place in ("heat", "trend-0", f"trend-{len(first.components) - 1}"):
        assert f'data-place="{place}"' in page
    assert first.plot().axes[0].get_title(loc="left").startswith("j0: median, 68 % and 95 % of 2 of 2 joints")
    for table in ("units", "findings"):
        rows = parquet.read_table(first.folder / f"{table}.parquet").to_pylist()
        made_by = {(one["settings"], one["version"], one["seed"]) for one in rows}
        assert made_by <= {(one, idloop.__version__, 0) for one in first.settings.digests.values()}
    sql = "select count(*), count(distinct sha256) from rows where parameter is not null"
    columns = Store(first.folder).query(sql).fetchone()
    assert columns == (BAGS * JOINTS * 4, BAGS)


def test_reports_of_joints_that_are_no_longer_there_are_removed(first, tmp_path):
    shutil.copytree(first.folder, tmp_path / "results")
    there = tmp_path / "results" / "joints"
    before = sorted(file.name for file in there.iterdir())
    for robot in ("robot000", "gone"):
        (there / f"{robot}.json").write_text(json.dumps({"robot": robot, "joint": "j0"}), encoding="utf-8")
        (there / f"{robot}.html").touch()
    (there / "former-1.html").touch()
    replace(first, folder=tmp_path / "results").save(tmp_path / "figure.png")
    assert sorted(file.name for file in there.iterdir()) == [*before, "robot000.html", "robot000.json"]
    document = json.loads((tmp_path / "results" / "fleet.json").read_text(encoding="utf-8"))
    assert document["plot"] == str(tmp_path / "figure.png")


def test_what_changed_since_a_date_is_compared(first, bags):
    found = again(first, bags, since="2026-03-02")
    assert {one.kind for one in found.periods if not one.robot} == set(MODELS)
    assert "change since 2026-03-02 against the days before" in found.summary()
    assert all(one.q_value <= found.level for one in found.periods if one.robot)


@pytest.mark.slow
def test_the_worst_joints_are_diagnosed_once_with_a_report(first, bags):
    found = idloop.identify_fleet(bags, dict(list(MODELS.items())[:1]), first.folder, workers=0, diagnose="all")
    assert len(found.diagnoses) == 2
    pages = [first.folder / one["report"] for one in found.diagnoses]
    before = [page.stat().st_mtime_ns for page in pages]
    found = idloop.identify_fleet(bags, dict(list(MODELS.items())[:1]), first.folder, workers=0, diagnose="all")
    assert [page.stat().st_mtime_ns for page in pages] == before
    found.save()
    page = (first.folder / "fleet.html").read_text(encoding="utf-8")
    assert all(one["report"] in page for one in found.diagnoses)


def test_a_watch_takes_what_has_come_to_rest(first, bags, monkeypatch):
    looks = [[FleetBag("r", "a", stamp="1")], [FleetBag("r", "a", stamp="2")], [FleetBag("r", "a", stamp="2")]]
    looks += [looks[-1], [*looks[-1], FleetBag("r", "b", stamp="1")], [*looks[-1], FleetBag("r", "b", stamp="1")]]
    ended, seen = threading.Event(), []
    number = iter(range(len(looks)))

    def find(source, *, empty):
        place = next(number)
        if place == len(looks) - 1:
            ended.set()
        return looks[place]

    monkeypatch.setattr("idloop.fleet.bags.find_bags", find)
    monkeypatch.setattr(fleet._Work, "run", lambda self, several: [one.bag for one in several])
    fleet.watch_fleet("anywhere", MODELS, first.folder, ended=ended, on_change=seen.append, period=0.0, workers=0)
    assert seen == [["a"], ["a", "b"]]


@pytest.mark.parametrize(
    ("options", "line"),
    [
        ({"level": 2.0}, "level is 2"),
        ({"diagnose": -1}, "diagnose is -1"),
        ({"since": "spring"}, "'spring' is no date"),
        ({"against": "2026-01-01"}, "without since"),
        ({"since": "2026-01-01", "against": "2026-01-02"}, "is not before"),
    ],
)
def test_bad_options_are_one_line(bags, tmp_path, options, line):
    with pytest.raises(InputError, match=line):
        idloop.identify_fleet(bags, MODELS, tmp_path, workers=0, **options)


@pytest.mark.parametrize(
    ("since", "against", "line"),
    [
        ("2026-03-03", None, "no recording from that date on: the recordings are from 2026-03-01 to 2026-03-02"),
        ("2026-03-01", None, "no recording before that date"),
        ("2026-03-01", "2026-02-01", "no recording from 2026-02-01 on before that date"),
    ],
)
def test_a_period_without_a_recording_is_refused_before_any_work(bags, tmp_path, since, against, line):
    with pytest.raises(InputError, match=line):
        idloop.identify_fleet(bags, MODELS, tmp_path, workers=0, since=since, against=against)
    assert list(tmp_path.iterdir()) == []


def test_joints_that_fit_badly_are_diagnosed_after_the_findings(first):
    class Worst(fleet._Work):
        def __init__(self, number):
            object.__setattr__(self, "asked", fleet._Asked(diagnose=number))

    names = tuple((f"r{k}", "j") for k in range(6))
    error = np.log([[0.9], [0.1], [0.8], [0.95], [0.2], [0.3]]) + np.zeros((6, 4))
    parts = take_apart(Series("k", FORCE_ERROR, "1", names, np.arange(4.0), error, np.zeros((6, 4))))
    findings = [Finding("odd", "k", "p", "N", "r1", "j", 0.0, 1.0, 0.5, 1.5, 1e-6)]
    worst = [Worst(count)._worst([parts], findings) for count in (1, 3, 5)]
    assert [[robot for robot, _ in one] for one in worst] == [["r1"], ["r1", "r3", "r0"], ["r1", "r3", "r0", "r2"]]


def test_a_conclusion_names_what_was_found_before_what_is_left():
    assert _found_and_left({}, "nothing is left") == "nothing is left"
    found = _found_and_left({"dead_zone@input": 1e-9, "cogging@axis": None}, "nothing is left")
    assert found == "missing from the model: dead_zone@input (p < 0.001), cogging@axis; beside that, nothing is left"
