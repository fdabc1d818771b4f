"""Effects that are one force as they were fitted: no experiment is offered for them, a check by hand is."""

from __future__ import annotations

from dataclasses import replace

import pytest

from idloop.diagnosis import Candidate, Ladder, Step
from idloop.physics import load_model
from idloop.reporting.same_force import same_forces
from idloop.reporting.workbench import state_json
from idloop.reporting.workbench.signals import Signals
from idloop.reporting.workbench.state import Missing, Snapshot

GRAVITY, IMBALANCE, SPRING = "gravity@motor", "imbalance@motor", "cable_spring@motor"


def fitted(text):
    name = text.partition("(")[0]
    effect, at = name.split("@")
    model = load_model("dc_motor").with_effects([text])
    return Candidate(effect, at, "yes", "", "It pulls.", 90.0, 1e-9, 0.9, model=model)


ARM = fitted(f"{GRAVITY}(moment=3.0)")
SAME = fitted(f"{IMBALANCE}(amplitude=3.02,phase=0.004)")
TURNED = fitted(f"{IMBALANCE}(amplitude=3.0,phase=0.5)")
CABLE = fitted(f"{SPRING}(stiffness=3.0)")


@pytest.mark.parametrize(
    ("several", "groups"),
    [
        ((ARM, SAME), [(GRAVITY, IMBALANCE)]),
        ((ARM, TURNED), []),  # an experiment shows the phase
        ((ARM, CABLE), []),  # a wide motion does
        ((CABLE, ARM, SAME), [(GRAVITY, IMBALANCE)]),
        ((ARM, replace(SAME, model=None)), []),
    ],
)
def test_they_are_one_where_no_angle_and_no_speed_separates_them(several, groups):
    assert [group.names for group in same_forces(several, [one.name for one in several])] == groups


def test_no_experiment_is_offered_for_one_force():
    ladder = Ladder((Step(None, load_model("dc_motor")),))
    found = Missing("missing", candidates=(ARM, SAME), set=(GRAVITY, IMBALANCE))
    said = state_json._missing(found, Snapshot(ladder=ladder))
    assert not said["separable"]
    (group,) = said["twins"]
    assert "gravity @ motor and imbalance @ motor" in group["text"]
    assert group["checks"][0].startswith("Tilt the axis")
    apart = Missing("missing", candidates=(ARM, TURNED), set=(GRAVITY, IMBALANCE))
    assert state_json._missing(apart, Snapshot(ladder=ladder))["separable"]


def test_an_experiment_that_would_say_nothing_has_no_signal():
    model = load_model("dc_motor")
    none = page_of({"text": "no experiment within these limits"}, model)
    assert none["signal"] == ""
    assert none["text"] == "No experiment within these limits"


def page_of(suggested, model):
    shown = Snapshot(model=model, suggested=suggested)
    return state_json.page_state(shown, Signals(model, capacity=200))["suggested"]
