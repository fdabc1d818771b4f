"""The benchmark of fleets counts what was planted, and what was found beside it."""

from __future__ import annotations

import sys
from types import SimpleNamespace

from tests.benchmarks.conftest import BENCHMARKS

from benchmarks import fleet

sys.path.append(str(BENCHMARKS))
DAY = fleet.START.timestamp() // 86400


def finding(what, robot, joint, kind="base", day=0.0):
    name = "" if robot is None else fleet.robot_name(robot)
    return SimpleNamespace(what=what, robot=name, joint=f"j{joint}", kind=kind, day=DAY + day)


def test_found_and_false_are_counted():
    plan = fleet.planted(20, 2, 10, odd=2, worn=1)
    assert len({*plan.odd, *plan.worn}) == 3
    (odd, _), (worn,) = plan.odd, plan.worn
    healthy = next(one for one in plan.units() if one not in {*plan.odd, *plan.worn})
    findings = [
        finding("odd", *odd), finding("trend", *worn), finding("day", *worn), finding("day", *healthy),
        finding("step", None, "", day=5.0), finding("step", None, "", kind="wrist", day=5.0),
    ]  # fmt: skip
    judged = fleet.judge(plan, findings, [findings[k] for k in (1, 3, 4)])
    counted = {name: (one["count"], one["of"]) for name, one in judged.items()}
    assert counted == {
        "odd units found": (1, 2),
        "wear found": (1, 1),
        "firmware found at its date": (1, 1),
        "false among what is listed": (2, 6),
        "false among the joints that changed since the firmware": (1, 2),
    }


def test_the_table_names_every_joint_and_its_kind(tmp_path):
    lines = fleet.write_table(tmp_path, fleet.Fleet(2, 3, 2)).read_text().splitlines()
    assert len(lines) == 1 + 2 * 3 * 2
    assert lines[3] == "robot000,j2,2026-03-01,robot000/2026-03-01,wrist"
