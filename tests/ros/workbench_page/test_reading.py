"""What the page says of the estimator's work."""

from __future__ import annotations

import json
import math

import pytest

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")

from idloop.diagnosis import Candidate
from idloop.diagnosis.ladder import SCHEMA
from idloop.errors import InputError
from idloop.physics import load_model
from idloop.reporting.workbench.state import Activity
from idloop_nodes.codec import (
    EffectEvidence,
    EvidenceSummary,
    LadderSummary,
    Level,
    MissingSummary,
    ParameterSummary,
    Status,
)
from idloop_nodes.workbench_page.reading import (
    MAXIMUM_POINTS,
    activity_of,
    automatic_of,
    evidence_of,
    ladder_of,
    missing_of,
)


def told(message, **values):
    return activity_of(Status("estimator: diagnosis", message, Level.OK, values))


def test_work_is_said_in_words_with_how_far_it_is():
    assert told("diagnose 70 %, refitting with coulomb_friction@motor", order="diagnose") == Activity(
        "looking for what is missing: refitting with Coulomb friction @ motor", 0.7
    )
    assert told("effects 10 %, round 1, objective -6047.61", order="effects") == Activity(
        "fitting with the chosen effects", 0.1
    )
    assert told("suggest", order="suggest") == Activity("working out the next experiment")


def test_what_waits_for_somebody_else_is_said_as_it_is():
    text = "the suggestion of an experiment"
    assert told(text, order=text) == Activity(text)


def test_what_the_estimator_does_unasked_is_read_from_its_health():
    def does(**values):
        return automatic_of(Status("estimator: diagnosis", "none yet", Level.OK, values))

    assert does(automatic="diagnose add experiment") == ("add", "experiment")
    assert does(automatic="diagnose") == does() == ()


def test_an_experiment_is_work_and_a_result_is_none():
    assert told("friction is missing", experiment="running") == Activity("the experiment is running")
    assert told("friction is missing", order="", experiment="") is None


def test_a_message_makes_no_effect_run_that_is_not_trusted(tmp_path):
    (tmp_path / "effects").mkdir()
    (tmp_path / "effects" / "lean.py").write_text(f"open({str(tmp_path / 'run')!r}, 'w').close()\n")
    model = load_model("dc_motor").to_yaml().replace("effects: []", "effects: [{effect: lean, at: motor, size: 1.0}]")
    assert "lean" in model
    document = json.dumps({"schema": SCHEMA, "ladder": [{"added": None, "model": model}]})
    lean = json.dumps(Candidate("lean", "motor", "yes", "", "").to_dict() | {"gain": None})
    found = f'{{"unknown": null, "untestable": [], "gate": {{"findings": []}}, "candidates": [{lean}]}}'
    head = Status("e: missing effects", values={"document": found, "verdict": "missing", "set": ""})
    missing = MissingSummary((head, Status("e: lean@motor", values={"fitted_model": model}, hardware_id="lean@motor")))
    with pytest.raises(InputError, match="which are not trusted"):
        missing_of(missing, tmp_path)
    with pytest.raises(InputError, match="which are not trusted"):
        ladder_of(LadderSummary((Status("e: ladder", values={"document": document}),)), tmp_path)
    assert not (tmp_path / "run").exists()


def looked(looks, *candidates, **more):
    """What is said after so many looks at five seconds and 500 samples each."""
    return EvidenceSummary(
        "m", looks=looks, samples=500 * looks, seconds=5.0 * looks, threshold=7.9, candidates=candidates, **more
    )


def test_the_page_keeps_how_the_evidence_has_grown():
    gain = ParameterSummary("drive.gain", 8.0, 0.01, "N·m/V", trusted=True, why="nothing is missing")
    slip, late = EffectEvidence("slip@motor", 3.0), EffectEvidence("cogging@motor", -1.0)
    decided = EffectEvidence("slip@motor", 9.0, 16 * 10**9, 1000)
    course = evidence_of(looked(1, slip), None)
    course = evidence_of(looked(2, decided, late, parameters=(gain,)), course)
    again = evidence_of(looked(2, decided, late, parameters=(gain,), ended="decided: slip@motor"), course)
    assert again.seconds == course.seconds == (5.0, 10.0)
    assert again.lines["slip@motor"] == (3.0, 9.0)
    assert math.isnan(again.lines["cogging@motor"][0])
    assert again.lines["cogging@motor"][1] == -1.0
    mark = again.decided["slip@motor"]
    assert (mark.seconds, mark.samples, mark.log_e) == (10.0, 1000, 9.0)
    assert again.ended == "decided: slip@motor"
    (estimate,) = again.estimates
    assert (estimate.name, estimate.text, estimate.trusted) == ("drive.gain", "8.000 ± 0.020 N·m/V", True)


def test_another_model_begins_a_new_course_and_a_long_one_forgets_its_beginning():
    course = evidence_of(looked(3, EffectEvidence("slip@motor", 3.0)), None)
    other = evidence_of(looked(4, effects=("slip@motor",)), course)
    assert (other.seconds, other.lines) == ((20.0,), {})
    assert evidence_of(looked(1), course).seconds == (5.0,), "a new run"
    for looks in range(4, MAXIMUM_POINTS + 10):
        course = evidence_of(looked(looks, EffectEvidence("slip@motor", float(looks))), course)
    assert len(course.seconds) == len(course.lines["slip@motor"]) == MAXIMUM_POINTS
    assert course.lines["slip@motor"][-1] == MAXIMUM_POINTS + 9


def test_a_page_that_comes_later_marks_at_the_threshold_what_it_has_not_seen():
    course = evidence_of(looked(6, EffectEvidence("slip@motor", 30.0, 16 * 10**9, 1000)), None)
    mark = course.decided["slip@motor"]
    assert (mark.seconds, mark.log_e) == (10.0, 7.9)
