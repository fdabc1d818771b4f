"""A fleet in words."""

from __future__ import annotations

import pytest

from idloop.fleet.joint_day import FORCE_ERROR
from idloop.fleet.statistics import Finding
from idloop.fleet.words import (
    failed_table,
    finding_row,
    finding_table,
    findings_words,
    fleet_blocks,
    headline,
    kind_table,
    periods_words,
    read_words,
)
from idloop.reporting.text.blocks import as_text

STEP = Finding("step", "arm", "p", "N", "r1", "j", 20513.0, 0.25, 0.2, 0.3, 1e-6)
DAY = Finding("day", "arm", FORCE_ERROR, "1", "r2", "j", 20514.0, 1.5, 1.0, 2.0, 0.01)
FAILED = "2 recordings or joints could not be identified"
KIND = Finding("trend", "arm", "p", "N", "", "", 20513.0, 0.25, 0.2, 0.3, 1e-6)


def document(*findings, failed=0, **more):
    rows = [finding_row(one) for one in findings]
    units = (("arm", 2), ("arm", 3), ("hand", 1))
    kinds = [{"kind": kind, "units": count} for kind, count in units]
    return {
        "findings": rows, "failed": [{}] * failed, "bags": 10, "kinds": kinds, "since": None, "against": None,
        "periods": [], **more,
    }  # fmt: skip


@pytest.mark.parametrize(
    ("given", "text"),
    [
        (document(), "4 joints in 10 recordings: nothing differs or changes"),
        (document(DAY), "4 joints in 10 recordings: 1 single recording is off the course of its joint"),
        (document(STEP), "4 joints in 10 recordings: 1 joint differs or changes"),
        (
            document(STEP, KIND, failed=2),
            f"4 joints in 10 recordings: 1 joint differs or changes; 1 kind changes as a whole; {FAILED}",
        ),
        (document(bags=1, kinds=[{"kind": "arm", "units": 1}]), "1 joint in 1 recording: nothing differs or changes"),
        (document(kinds=[]), "nothing was identified"),
    ],
)
def test_a_headline_counts_joints_and_kinds(given, text):
    assert headline(given) == text


@pytest.mark.parametrize(
    ("new", "text"),
    [
        (36, "36 recordings were read"),
        (1, "1 recording was read now, 35 before"),
        (0, "no recording is new; 36 were read before"),
    ],
)
def test_recordings_are_new_or_known(new, text):
    assert read_words(new, 36) == text


def test_an_empty_period_is_said():
    nothing = document(since="2026-03-04", against="2026-03-01")
    assert periods_words(nothing) == (
        "nothing to compare since 2026-03-04 with the days from 2026-03-01 on: no joint has recordings in both"
    )
    assert periods_words(document(since="2026-03-04", periods=[{}])).startswith(
        "change since 2026-03-04 against the days before: kinds first"
    )


def test_a_fleet_without_a_test_says_what_one_takes():
    assert findings_words(document(tests=0)).startswith("no test yet: ")
    assert findings_words(document(tests=1)) == "1 test, no finding"
    assert "at most 5 % is false" in findings_words(document(STEP, tests=20, level=0.05))


def test_a_reason_does_not_repeat_the_bag_beside_it():
    reasons = ("/bags/one/one.mcap: cut off", "no bag /bags/one: check the path", "joint a: no model")
    rows = [{"robot": "r", "joint": None, "time": None, "bag": "/bags/one", "reason": one} for one in reasons]
    table = failed_table({"failed": rows})
    assert [row[-1] for row in table.rows] == ["cut off", *reasons[1:]]


def test_what_too_few_joints_share_is_not_stated():
    one = {"kind": "arm", "parameter": "p", "unit": "N", "mean": 2.0, "day_deviation": 0.2, "error": 0.1}
    shares = {"unit_deviation": 0.4, "date_deviation": 0.02}
    table = kind_table({"kinds": [{**one, **shares, "units": units, "recordings": 4} for units in (1, 4, 5)]})
    assert [row[5:] for row in table.rows] == [
        ("-", "-", "10 %", "5 %"), ("20 %", "-", "-", "5 %"), ("20 %", "1 %", "-", "5 %"),
    ]  # fmt: skip


def test_nothing_identified_has_no_empty_tables():
    bags = [{"robot": "r", "joint": None, "time": None, "bag": "b", "reason": "cut off"}]
    text = as_text(fleet_blocks(document(kinds=[], new=1, bags=1, diagnoses=[]) | {"failed": bags}))
    assert text.splitlines()[:4] == ["nothing was identified", "1 recording was read", "", "not identified"]
    assert "finding" not in text


def test_a_finding_has_its_date_size_and_interval():
    table = finding_table([finding_row(one) for one in (STEP, DAY, KIND)])
    assert table.rows[0] == ("r1", "j", "p", "changes at once", "2026-03-01", "+0.25", "0.2 .. 0.3", "N", "< 0.001")
    assert table.rows[1][5:8] == ("+150", "100 .. 200", "%")
    assert table.rows[2][:2] == ("all of arm", "-")
