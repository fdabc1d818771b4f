"""What the page says of the estimator's work."""

from __future__ import annotations

import pytest

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")

from idloop.workbench.source import Activity
from idloop_nodes.codec import Level, Status
from idloop_nodes.workbench_reading import activity_of, automatic_of


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
