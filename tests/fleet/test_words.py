"""A fleet in words."""

from __future__ import annotations

import pytest

from idloop.fleet.joint_day import FORCE_ERROR
from idloop.fleet.statistics import Finding
from idloop.fleet.words import finding_row, finding_table, headline

STEP = Finding("step", "arm", "p", "N", "r1", "j", 20513.0, 0.25, 0.2, 0.3, 1e-6)
DAY = Finding("day", "arm", FORCE_ERROR, "1", "r2", "j", 20514.0, 1.5, 1.0, 2.0, 0.01)
FAILED = "2 recordings or joints could not be identified"
KIND = Finding("trend", "arm", "p", "N", "", "", 20513.0, 0.25, 0.2, 0.3, 1e-6)


def document(*findings, failed=0):
    rows = [finding_row(one) for one in findings]
    return {"findings": rows, "failed": [{}] * failed, "joint_days": 10, "kinds": [{"units": 2}]}


@pytest.mark.parametrize(
    ("given", "text"),
    [
        (document(), "10 recordings of joints: no joint differs or changes"),
        (document(DAY), "10 recordings of joints: no joint differs or changes"),
        (document(STEP), "10 recordings of joints: 1 joint differs or changes"),
        (
            document(STEP, KIND, failed=2),
            f"10 recordings of joints: 1 joint differs or changes; 1 kind changes as a whole; {FAILED}",
        ),
        ({**document(), "kinds": []}, "nothing was identified"),
    ],
)
def test_a_headline_counts_joints_and_kinds(given, text):
    assert headline(given) == text


def test_a_finding_has_its_date_size_and_interval():
    table = finding_table([finding_row(one) for one in (STEP, DAY, KIND)])
    assert table.rows[0] == ("r1", "j", "p", "changes at once", "2026-03-01", "+0.25", "0.2 .. 0.3", "N", "< 0.001")
    assert table.rows[1][5:8] == ("+150", "100 .. 200", "%")
    assert table.rows[2][:2] == ("all of arm", "-")
