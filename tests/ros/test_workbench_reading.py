"""What the page says of the estimator's work."""

from __future__ import annotations

import json

import pytest

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")

from idloop.diagnose.ladder import SCHEMA
from idloop.errors import InputError
from idloop.physics import load_model
from idloop.workbench.source import Activity
from idloop_nodes.codec import EffectSummary, LadderSummary, Level, Status
from idloop_nodes.workbench_reading import activity_of, automatic_of, candidate_of, ladder_of


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
    with pytest.raises(InputError, match="which are not trusted"):
        candidate_of(EffectSummary("lean", "motor", fitted_model=model), tmp_path)
    with pytest.raises(InputError, match="which are not trusted"):
        ladder_of(LadderSummary("run", document=document), tmp_path)
    assert not (tmp_path / "run").exists()
