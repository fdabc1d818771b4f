"""The rows of the papers: how answers are judged, and that the experiments can show what they hide."""

from __future__ import annotations

import json
import math
from types import SimpleNamespace

import numpy as np
import pytest
from paper_dc_motor import DEAD_ZONE, THESIS, implied, thesis_gains, true_motor
from paper_records import answer, plain_numbers, recorded, table
from paper_rows import jobs, parsed
from paper_torsion import ALL, CASES, EFFECTS, reference, torsion


def ladder(model, *steps):
    """A ladder with these rungs: each a name, or several that the data cannot tell apart."""
    start = SimpleNamespace(added=None, set=(), p_value=None)
    rungs = [SimpleNamespace(added=SimpleNamespace(name=names[0]), set=names, p_value=1e-9) for names in steps]
    return SimpleNamespace(steps=[start, *rungs], model=model, candidates=(), verdict="adequate")


def test_the_dead_zone_is_read_off_a_table_of_gains():
    gains = {u: 10.0 * (1.0 - 0.12 / u) for u in THESIS}
    assert implied(gains) == pytest.approx((10.0, 0.12))


def test_the_published_gains_hold_a_dead_zone_near_the_measured_one():
    assert implied(thesis_gains())[1] == pytest.approx(DEAD_ZONE, abs=0.01)


def test_friction_takes_its_part_of_the_dead_zone():
    values = true_motor(0.25).values
    friction = values["coulomb_friction@motor.level"] / values["drive.gain"]
    assert values["dead_zone@input.width"] + friction == pytest.approx(DEAD_ZONE)


def test_an_answer_is_right_when_all_is_named_and_nothing_else():
    truth = torsion(("offset", "friction"))
    found = answer(ladder(truth, ("coulomb_friction@motor",), ("load_torque@motor", "input_offset@input")), truth, 1.0)
    assert found.right
    assert [rung.how for rung in found.rungs] == ["found", "in the set"]


def test_a_constant_torque_is_held_against_the_offset_that_it_stands_for():
    truth = torsion(("offset",))
    model = torsion(()).with_effect("load_torque", "motor", torque=0.003)
    (rung,) = answer(ladder(model, ("load_torque@motor", "input_offset@input")), truth, 1.0).rungs
    assert rung.estimates[0].true == pytest.approx(0.0397 * 0.0742)


@pytest.mark.parametrize("named", [(), ("slip@motor-load1", "dead_zone@input")])
def test_an_answer_is_wrong_when_something_is_missed_or_false(named):
    truth = torsion(("slip",))
    assert not answer(ladder(truth, *((name,) for name in named)), truth, 1.0).right


def test_a_phase_is_compared_on_the_circle():
    truth = torsion(("imbalance",))
    turned = truth.with_values({"imbalance@motor.phase": 0.4 - 2.0 * math.pi})
    (rung,) = answer(ladder(turned, ("imbalance@motor",)), truth, 1.0).rungs
    phase = next(e for e in rung.estimates if e.name == "phase")
    assert phase.value == pytest.approx(0.4)


def test_words_stand_to_the_left_and_numbers_to_the_right():
    lines = table(("what", "value"), [["a", "1"], ["bcdef", "10"]], indent="").splitlines()
    assert lines[2:] == ["a          1", "bcdef     10"]


def test_what_is_no_number_becomes_none_in_the_document():
    assert json.loads(json.dumps(plain_numbers({"a": [math.nan, 1.0], "b": np.float64(2.0)}))) == {
        "a": [None, 1.0],
        "b": 2.0,
    }


def test_every_row_runs_with_every_seed():
    todo = jobs(parsed(["--seeds", "1", "2", "--disturbance", "1"]))
    assert [row for row, _ in todo] == ["A6"] * 4 + ["B2"] * 2 * len(CASES) + ["B9"] * 2


def test_the_experiments_on_the_torsion_system_can_show_what_they_hide():
    truth = torsion(ALL)
    moves, steps = (recorded(truth, reference(kind, 1.0, 5), "equations", 5) for kind in ("moves", "steps"))
    assert np.ptp(moves.output[:, 0]) > 2.0 * 2.0 * np.pi
    assert np.max(np.abs(steps.input)) > EFFECTS["saturation"][2]["limit"]
    assert np.ptp(steps.output[:, 0] - steps.output[:, 1]) > 2.0 * EFFECTS["slip"][2]["limit"]
