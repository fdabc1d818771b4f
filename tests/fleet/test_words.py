"""A fleet in words."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from idloop.fleet.joint_day import FORCE_ERROR
from idloop.fleet.statistics import RELATIVE, Finding, Series, take_apart
from idloop.fleet.words import (
    component_row,
    diagnosis_words,
    failed_table,
    finding_row,
    finding_table,
    findings_words,
    fleet_blocks,
    headline,
    kind_table,
    kind_text,
    level_table,
    misfit_rows,
    misfit_words,
    misfits,
    periods_words,
    read_words,
    unit_rows,
)
from idloop.reporting.text.blocks import as_text

STEP = Finding("step", "arm", "p", "N", "r1", "j", 20513.0, 0.25, 0.2, 0.3, 1e-6)
DAY = Finding("day", "arm", FORCE_ERROR, RELATIVE, "r2", "j", 20514.0, 1.5, 1.0, 2.0, 0.01)
FAILED = "2 recordings or joints could not be identified"
DIFFERS = "whether a joint differs from its kind, which takes 5 joints of a kind"
FEW = (DIFFERS, "whether a joint changes, which takes 4 recordings of it at least")
KIND = Finding("trend", "arm", "p", "N", "", "", 20513.0, 0.25, 0.2, 0.3, 1e-6)


def document(*findings, failed=0, **more):
    rows = [finding_row(one) for one in findings]
    units = (("arm", 5), ("arm", 6), ("hand", 5))
    kinds = [{"kind": kind, "units": count, "followed": count} for kind, count in units]
    return {
        "findings": rows, "failed": [{}] * failed, "bags": 10, "kinds": kinds, "since": None, "against": None,
        "misfits": [], "periods": [], "level": 0.05, **more,
    }  # fmt: skip


@pytest.mark.parametrize(
    ("given", "text"),
    [
        (document(), "11 joints in 10 recordings: nothing differs or changes"),
        (document(DAY), "11 joints in 10 recordings: 1 single recording is off the course of its joint"),
        (document(STEP), "11 joints in 10 recordings: 1 joint differs or changes"),
        (
            document(STEP, KIND, failed=2),
            f"11 joints in 10 recordings: 1 joint differs or changes; 1 kind changes as a whole; {FAILED}",
        ),
        (
            document(bags=1, kinds=[{"kind": "arm", "units": 1, "followed": 0}]),
            "; not tested: ".join(["1 joint in 1 recording: nothing that was tested differs or changes", *FEW]),
        ),
        (
            document(STEP, kinds=[{"kind": kind, "units": n, "followed": n} for kind, n in (("arm", 5), ("*", 4))]),
            f"9 joints in 10 recordings: 1 joint differs or changes; not tested for other joints: {DIFFERS}",
        ),
        (
            document(misfits=[{"kind": "arm", "joints": 2, "of": 6, "force_error": 0.74}]),
            "11 joints in 10 recordings: 2 joints are fitted badly by the model; nothing differs or changes",
        ),
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
        "change since 2026-03-04 against the days before: of each kind as a whole, significant or not; then of"
    )


def test_a_fleet_without_a_test_says_what_one_takes():
    assert findings_words(document(tests=0)).startswith("no test yet: ")
    assert findings_words(document(tests=1)).startswith("1 test, no finding; most changes are found from five to eight")
    assert "at most 5 % is false" in findings_words(document(STEP, tests=20, level=0.05))


def test_a_reason_does_not_repeat_the_bag_beside_it():
    reasons = ("/bags/one/one.mcap: cut off", "/bags/one: there is no bag, check the path", "joint a: no model")
    rows = [{"robot": "r", "joint": None, "time": None, "bag": "/bags/one", "reason": one} for one in reasons]
    table = failed_table({"failed": rows})
    assert [row[-1] for row in table.rows] == ["cut off", "there is no bag, check the path", reasons[2]]


def test_a_reason_of_many_recordings_is_one_row():
    rows = [
        {"robot": f"r{k}", "joint": None, "time": None, "bag": f"/bags/r{k}", "reason": f"/bags/r{k}: no model fits"}
        for k in range(30)
    ]
    cut = {"robot": "r1", "joint": None, "time": None, "bag": "/bags/r1", "reason": "/bags/r1/a.mcap: cut off"}
    table = failed_table({"failed": [*rows, cut]})
    assert table.rows == (("30 robots", "-", "-", "30 bags", "no model fits"), ("r1", "-", "-", "/bags/r1", "cut off"))
    assert len(failed_table({"failed": [*rows, cut]}, merged=False).rows) == 31


def test_what_too_few_joints_share_is_not_stated():
    one = {"kind": "arm", "parameter": "p", "unit": "N", "mean": 2.0, "day_deviation": 0.2, "error": 0.1, "kept": 4}
    shares = {"unit_deviation": 0.4, "date_deviation": 0.02}
    table = kind_table({"kinds": [{**one, **shares, "units": units, "recordings": 4} for units in (1, 4, 5)]})
    assert [row[2] for row in table.rows] == ["4 of 1", "4", "4 of 5"]
    assert [row[5:] for row in table.rows] == [
        ("-", "-", "10 %", "5 %"), ("20 %", "-", "-", "5 %"), ("20 %", "1 %", "-", "5 %"),
    ]  # fmt: skip


def test_a_share_is_written_without_a_power_of_ten():
    one = {"kind": "arm", "parameter": "p", "unit": "N", "mean": 1.0, "kept": 6, "units": 6, "recordings": 36}
    parts = {"unit_deviation": 1.304, "date_deviation": 0.9951, "day_deviation": 0.01234, "error": 12.5}
    (row,) = kind_table({"kinds": [one | parts]}).rows
    assert row[5:] == ("130 %", "100 %", "1.2 %", "1250 %")


def test_nothing_identified_has_no_empty_tables():
    bags = [{"robot": "r", "joint": None, "time": None, "bag": "b", "reason": "cut off"}]
    text = as_text(fleet_blocks(document(kinds=[], new=1, bags=1, diagnoses=[]) | {"failed": bags}))
    assert text.splitlines()[:4] == ["nothing was identified", "1 recording was read", "", "not identified"]
    assert "finding" not in text


def test_a_finding_has_its_date_size_and_interval():
    table = finding_table(document(STEP, DAY, KIND), "findings")
    assert table.rows[0] == (
        "r1",
        "j",
        "p",
        "step: changes at once",
        "2026-03-01",
        "+0.25",
        "0.2 .. 0.3",
        "N",
        "< 0.001",
    )
    assert table.rows[1][5:8] == ("× 2.5", "2 .. 3", "times as much")
    assert table.rows[2][:2] == ("all of arm", "-")


def test_the_pattern_of_all_joints_has_words_for_a_name():
    assert [kind_text("*", several) for several in (["*", "*"], ["arm", "*"])] == ["all joints", "other joints"]
    assert kind_text("arm", ["arm"]) == "arm"
    alone = document(replace(KIND, kind="*"), kinds=[{"kind": "*", "units": 3, "followed": 3}])
    assert finding_table(alone, "findings").rows[0][0] == "all joints"


def test_a_diagnosis_says_how_often_it_errs():
    several = document(diagnosis_level=0.01, diagnoses=[{}] * 250)
    assert diagnosis_words(several).endswith("with a probability of 1 %, which is 2.5 of 250 on average")


def test_what_changed_since_a_date_is_in_the_headline():
    joint = replace(STEP, what="beyond", q_value=0.01)
    several = {"periods": [finding_row(one) for one in (KIND, joint)], "since": "2026-03-01"}
    assert headline(document(**several)) == "11 joints in 10 recordings: 1 joint has changed since 2026-03-01"
    several["periods"][0]["q_value"] = 0.01
    whole = "1 joint has changed since 2026-03-01; 1 kind has changed as a whole since 2026-03-01"
    assert headline(document(STEP, **several)) == f"11 joints in 10 recordings: 1 joint differs or changes; {whole}"


def test_every_number_of_a_joint_is_in_the_unit_of_its_parameter():
    names = tuple((f"r{k}", "j") for k in range(6))
    share = np.exp(np.log(0.1) + 0.2 * np.random.default_rng(0).normal(size=(6, 1)) + np.zeros((6, 4)))
    series = Series("arm", FORCE_ERROR, "1", names, np.arange(4.0), np.log(share), np.zeros((6, 4)))
    parts = take_apart(series)
    rows = list(unit_rows([parts]))
    assert [one["level"] for one in rows] == pytest.approx(share[:, 0])
    assert rows[0]["kind_mean"] == pytest.approx(0.1, rel=0.3)
    assert rows[0]["unit_deviation"] == pytest.approx(rows[0]["kind_mean"] * parts.unit_deviation)
    kind = component_row(parts)
    assert (kind["mean"], kind["unit"]) == (rows[0]["kind_mean"], "1")
    (row,) = kind_table({"kinds": [kind]}).rows
    assert (float(row[3]), row[4], row[-1]) == (
        pytest.approx(100.0 * kind["mean"], rel=1e-3),
        "% of drive force",
        "-",
    )
    assert level_table([parts]).rows[0][3:8:4] == (f"{100.0 * share[0, 0]:.4g}", "% of drive force")
    assert all(one["low"] <= one["level"] <= one["high"] for one in rows)


@pytest.mark.parametrize(("error", "count"), [(0.74, 6), (0.7, 0)])
def test_a_model_that_explains_less_than_half_of_the_power_is_a_bad_one(error, count):
    names = tuple((f"r{k}", "j") for k in range(6))
    logs = np.log(error) + 0.001 * np.random.default_rng(0).normal(size=(6, 4))
    parts = take_apart(Series("arm", FORCE_ERROR, "1", names, np.arange(4.0), logs, np.zeros((6, 4))))
    found = list(misfit_rows([parts]))
    assert [(one["kind"], one["joints"], one["of"]) for one in found] == [("arm", count, 6)] * bool(count)
    said = list(misfit_words(document(misfits=found)))
    assert len(said) == bool(count)
    assert all("6 of 6 joints badly" in one and "74" in one and "--diagnose" in one for one in said)
    assert set(misfits(parts)) == set(names[:count])
    text = as_text(fleet_blocks(document(kinds=[], misfits=found, new=1, diagnoses=[])))
    assert ("warning: arm: the model fits" in text) == bool(count)
