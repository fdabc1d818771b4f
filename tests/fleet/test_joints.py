"""A report of every joint: files, what is in them, and one of them in a browser."""

from __future__ import annotations

import json
import re
import shlex
from dataclasses import replace
from datetime import datetime, timedelta, timezone
from urllib.parse import quote

import numpy as np
import pytest

import idloop
from idloop.cli import main
from idloop.fleet import joints
from idloop.fleet.joint_day import FORCE_ERROR
from idloop.fleet.joints import addresses, file_stems, joint_files, of_files, render_joints
from idloop.fleet.page import render_fleet
from idloop.fleet.statistics import Series, take_apart
from idloop.fleet.store import Recording
from idloop.fleet.words import level_table

NAMES = tuple((f"r{k}", name) for k in range(4) for name in ("a", "b"))
DAYS = np.arange(6.0) + 20000.0
START = datetime(1970, 1, 1, tzinfo=timezone.utc) + timedelta(days=20000)
KIND = {
    "kind": "kind", "parameter": "p", "unit": "N", "units": 8, "kept": 8, "followed": 8,
    "recordings": 48, "mean": 1.0, "unit_deviation": 0.1,
    "date_deviation": 0.0, "day_deviation": 0.0, "error": 0.01,
}  # fmt: skip
ODD = "</script>"  # a bag with such a name must not end the script that holds it


@pytest.fixture(scope="module")
def components():
    y = 1.0 + 0.1 * np.random.default_rng(0).normal(size=(len(NAMES), len(DAYS)))
    parameter = Series("kind", "p", "N", NAMES, DAYS, y, np.full(y.shape, 1e-4))
    return take_apart(parameter), take_apart(Series("kind", FORCE_ERROR, "1", NAMES, DAYS, np.log(0.05 * y), 0.0 * y))


@pytest.fixture(scope="module")
def recorded(components):
    return [
        Recording(robot, joint, START + timedelta(days=day), f"bags/{robot}/{day}{ODD}", 0.04, 0.2, "N", 10.0, None,
                  {"p": (float(y), 0.01), FORCE_ERROR: (0.05, None)})
        for (robot, joint), row in zip(NAMES, components[0].series.value, strict=True) for day, y in enumerate(row)
    ]  # fmt: skip


@pytest.fixture(scope="module")
def document():
    found = {"kind": "kind", "parameter": "p", "unit": "N", "day": "2024-10-05", "size": 0.5, "low": 0.4, "high": 0.6}
    return {
        "source": "fleet.csv", "folder": "runs", "version": "1", "settings": {"kind": "s"}, "seed": 0,
        "level": 0.05, "tests": 9, "since": None, "against": None, "misfits": [], "new": 24, "bags": 24,
        "joint_days": 48, "periods": [], "alarms": [], "recordings_per_false_alarm": 10_000,
        "kinds": [KIND],
        "findings": [{"what": "odd", "robot": "r1", "joint": "b", "p_value": 1e-9, **found}],
        "diagnosis_level": 0.01,
        "diagnoses": [{"robot": "r1", "joint": "b", "conclusion": "all is well", "report": "joints/r1-b-0.html"}],
        "failed": [{"robot": "r1", "joint": None, "time": "2024-10-09", "bag": "bags/r1/9", "reason": "cut off"}],
    }  # fmt: skip


def page(components, document, recorded) -> str:
    (file,) = joint_files(components)
    return render_joints(file, document, recorded, "runs/models/kind.yaml", "axis")


def held(html):
    return json.loads(re.search(r'id="joints">(.*?)</script>', html, re.DOTALL)[1])


def test_a_joint_that_is_fitted_badly_has_a_warning(components, document, recorded):
    level, error = components
    bad = np.arange(len(NAMES))[:, None] == 3
    series = replace(error.series, value=np.where(bad, np.log(0.9), error.series.value))
    (file,) = joint_files((level, take_apart(series)))
    found = held(render_joints(file, document, recorded, "runs/models/kind.yaml", "axis"))["joints"]
    warned = {name: one["warning"] for name, one in found.items() if one["warning"]}
    assert list(warned) == [" ".join(NAMES[3])]
    assert "fits this joint badly" in warned["r1 b"]
    assert "89.3 %" in warned["r1 b"]


def test_no_bar_of_a_joint_reaches_below_the_bound_of_its_parameter(components, document, recorded):
    bounded = [replace(one, series=replace(one.series, least=0.92)) for one in components]
    curve = held(page(bounded, document, recorded))["joints"]["r1 b"]["curves"]["trend-0"]
    assert min(curve["low"]) == 0.92 < min(curve["y"])


def test_every_joint_is_in_one_file(components, monkeypatch):
    (whole,) = joint_files(components)
    assert whole.names == NAMES
    monkeypatch.setattr(joints, "MOST_RECORDINGS", 3 * len(DAYS))
    files = joint_files(components)
    assert [len(one.names) for one in files] == [3, 3, 2]
    assert [name for one in files for name in one.names] == list(NAMES)
    assert len(set(addresses(files).values())) == len(NAMES)
    assert addresses(files)["r3", "b"] == f"{files[2].path}?r3 b"


def test_recordings_come_to_the_file_of_their_joint(components, recorded, monkeypatch):
    monkeypatch.setattr(joints, "MOST_RECORDINGS", 3 * len(DAYS))
    files = joint_files(components)
    pairs = [(file, {(one.robot, one.joint) for one in own}) for file, own in of_files(files, recorded)]
    assert pairs == [(file, set(file.names)) for file in files]


def test_a_pattern_of_names_is_a_file():
    assert file_stems(["*", "j[1-3]", "j_1-3", "wrist"]) == {
        "*": "all", "j[1-3]": "j_1-3", "j_1-3": "j_1-3-3", "wrist": "wrist",
    }  # fmt: skip


def test_a_joint_has_its_rows_points_and_command(components, document, recorded):
    found = held(page(components, document, recorded))
    one, rows = found["joints"]["r1 b"], found["rows"]
    assert one["headline"] == "Compared with kind; 6 recordings from 2024-10-04 to 2024-10-09"
    assert one["curves"]["trend-1"]["y"] == [5.0] * 6, "percent"
    curve = one["curves"]["trend-0"]
    np.testing.assert_allclose(np.subtract(curve["high"], curve["low"]), 2 * 1.96 * 0.01, rtol=1e-3)
    assert curve["x"][1] - curve["x"][0] == 86_400_000.0
    newest = next(row for row in rows["recordings"] if row[:2] == ["r1", "b"])
    assert newest[2] == "2024-10-09"
    assert newest[4:8] == ["5", "4", "0.2 N", "10"]
    assert [row[2] for row in rows["levels"] if row[:2] == ["r1", "b"]] == ["p", FORCE_ERROR]
    assert rows["failed"] == [["r1", "-", "2024-10-09", "bags/r1/9", "cut off"]]
    assert shlex.split(one["command"])[1:] == [
        "refine", "runs/models/kind.yaml", f"bags/r1/5{ODD}", "--joint", "axis=b", "--criterion", "force",
        "--output", "r1-b-2024-10-09",
    ]  # fmt: skip


def test_joints_that_are_alike_are_as_far_from_their_kind_as_their_errors(components):
    alike = [replace(one, unit_deviation=0.0, level=one.mean + 2.0 * one.level_stderr) for one in components]
    assert {row[-1] for row in level_table(alike).rows} == {"+2.0 σ"}


def test_a_recording_at_an_address_is_fetched_by_the_command(components, document, recorded):
    there = [one._replace(bag=f"s3://robots/{one.robot}/day") for one in recorded]
    copy, refine = held(page(components, document, there))["joints"]["r0 a"]["command"].splitlines()
    assert "url_to_fs('s3://robots/r0/day')" in shlex.split(copy)[2]
    assert shlex.split(refine)[3] == "day"


@pytest.mark.slow
def test_a_click_on_the_heat_map_opens_the_report_of_the_joint(components, document, recorded, browser, tmp_path):
    (file,) = joint_files(components)
    (tmp_path / "joints").mkdir()
    html = page(components, document, recorded)
    (tmp_path / file.path).write_text(html, encoding="utf-8")
    fleet = tmp_path / "fleet.html"
    fleet.write_text(render_fleet(document, components, addresses([file])), encoding="utf-8")
    context, bad = browser.new_context(offline=True, viewport={"width": 1280, "height": 900}), []
    context.on("weberror", lambda error: bad.append(str(error)))
    context.on("console", lambda said: bad.append(said.text) if said.type in {"error", "warning"} else None)
    first = context.new_page()
    first.goto(fleet.as_uri())
    first.wait_for_selector("html[data-ready]", timeout=200_000)
    heat = first.locator('figure[data-place="heat"]')
    box = heat.bounding_box()
    with context.expect_page() as opened:
        heat.click(position={"x": 0.5 * box["width"], "y": 0.5 * box["height"]})
    one = opened.value
    one.wait_for_selector("html[data-ready]", timeout=200_000)
    assert tuple(one.locator("h1").inner_text().split()) in NAMES
    one.goto((tmp_path / file.path).as_uri() + "?" + quote("r1 b"))
    one.wait_for_selector("html[data-ready]", timeout=200_000)
    assert one.locator("h1").inner_text() == "r1 b"
    assert one.locator("#recordings tbody tr").count() == 6
    assert one.locator("#findings tbody tr").count() == one.locator("#failed tbody tr").count() == 1
    assert one.locator("#diagnoses a").get_attribute("href") == "r1-b-0.html"
    assert one.locator("#alarms").is_hidden()
    drawn = "[...Bokeh.documents].map((one) => one.get_model_by_name('trend-0')?.data.y.length ?? 0)"
    assert sorted(one.evaluate(drawn)) == [0, 6]
    one.locator("#theme").click()
    one.wait_for_selector("html[data-ready]", timeout=200_000)
    assert max(one.evaluate(drawn)) == 6, "also in the other colours"
    numbered = html.replace('"r1 b"', '"r#1 b"').replace('["r1","b"', '["r#1","b"')
    (tmp_path / file.path).write_text(numbered, encoding="utf-8")
    one.goto((tmp_path / file.path).as_uri() + "?r#1 b")
    one.wait_for_selector("html[data-ready]", timeout=200_000)
    assert one.locator("h1").inner_text() == "r#1 b"
    one.goto((tmp_path / file.path).as_uri() + "?nobody")
    one.wait_for_selector("html[data-ready]", timeout=200_000)
    assert "No joint of this name" in one.locator("main").inner_text()
    context.close()
    assert bad == []


@pytest.mark.slow
def test_the_command_of_a_joint_gives_its_full_report(recordings, tmp_path, monkeypatch, settings):
    monkeypatch.chdir(tmp_path)
    models = dict(settings.kinds)
    idloop.identify_fleet(recordings, models, "out", workers=0, diagnose=0).save()
    html = (tmp_path / "out" / "joints" / "all-1.html").read_text(encoding="utf-8")
    command = held(html)["joints"]["robot001 j1"]["command"]
    assert main.run([*shlex.split(command)[1:], "--most", "1", "--no-suggest"]) == 0
    assert list(tmp_path.glob("robot001-j1-*/report.html"))
