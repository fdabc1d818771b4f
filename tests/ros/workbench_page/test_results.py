"""Results of the estimator on the page: none of the model before the last step comes back."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")

from idloop.diagnosis import Candidate, Ladder, Step
from idloop.physics import load_model
from idloop.reporting.workbench.assessment import Assessment
from idloop.reporting.workbench.state import Missing
from idloop.reporting.workbench.state_json import page_state
from idloop.validation.where import Where
from idloop_nodes.codec import (
    FitSummary,
    ParameterSummary,
    fit_to_statuses,
    ladder_to_statuses,
    parameters_to_statuses,
)
from idloop_nodes.workbench_page.reading import PageResults
from idloop_nodes.workbench_page.source import LiveSource

MODEL = load_model("dc_motor")
ADDED = MODEL.with_effects(["dead_zone@input(width=0.8)"])


def fit(effects, value):
    summary = FitSummary(
        MODEL.name, effects, "prediction", (0, 10**10), (10**10, 2 * 10**10), {"motor.position": value}
    )
    return fit_to_statuses("estimator", summary)


def ladder(*models):
    steps = [Step(None, models[0])]
    steps += [Step(Candidate("dead_zone", "input", "yes", "", "It gives."), one) for one in models[1:]]
    return ladder_to_statuses("estimator", Ladder(tuple(steps)), None, 0).statuses


@pytest.fixture
def source():
    one = LiveSource(MODEL, 100, lambda: 20.0)
    yield one
    one.close()


def head(source):
    shown = page_state(source.state.snapshot, source.signals)["head"]
    return [one["text"].replace("\u00a0", " ") for one in shown["scores"]], shown["pending"]


def test_a_fit_that_was_under_way_when_a_step_was_taken_is_not_the_present_model(source):
    results = PageResults(source, MODEL)
    results.take_ladder(ladder(MODEL))
    results.take_fit(fit((), 28.6))
    assert head(source) == (["28.6 %"], False)
    results.take_ladder(ladder(MODEL, ADDED))
    assert source.state.snapshot.effects == ("dead_zone@input",)
    assert head(source)[1], "a number of the model before"
    results.take_fit(fit((), 28.5))
    assert source.state.snapshot.effects == ("dead_zone@input",)
    assert head(source)[1]
    results.take_fit(fit(("dead_zone@input",), 98.8))
    assert head(source) == (["98.8 %"], False)
    results.take_ladder(ladder(MODEL))
    assert source.state.snapshot.effects == ()
    assert head(source)[1]


def test_a_live_model_that_was_set_by_its_effects_is_shown_without_a_ladder(source):
    results = PageResults(source, MODEL)
    results.take_fit(fit(("dead_zone@input",), 98.8))
    assert source.state.snapshot.effects == ("dead_zone@input",)
    assert head(source) == (["98.8 %"], False)


def test_parameters_of_a_fit_come_with_their_intervals_and_only_to_the_model_they_are_of(source):
    results = PageResults(source, MODEL)
    told = [
        ParameterSummary(name, value, 0.01) for name, value in (("drive.gain", 8.0), ("motor.viscous_friction", 2.0))
    ]
    results.take_parameters(parameters_to_statuses("estimator", told))
    rows = {row["key"]: row for row in page_state(source.state.snapshot, source.signals)["parameters"]}
    assert rows["drive.gain"]["value"].replace("\u00a0", " ") == "8.000 ± 0.020"
    assert rows["drive.gain"]["kind"] == "estimated"
    results.take_ladder(ladder(MODEL, ADDED))
    results.take_parameters(parameters_to_statuses("estimator", told))
    assert source.model.values["drive.gain"] == ADDED.values["drive.gain"]
    # After a step back those of the longer model are late as well.
    results.take_ladder(ladder(MODEL))
    results.take_parameters(
        parameters_to_statuses("estimator", [*told, ParameterSummary("dead_zone@input.width", 0.8, 0.01)])
    )
    assert source.model.values["drive.gain"] == MODEL.values["drive.gain"]


def test_a_free_run_that_somebody_looks_at_follows_the_data(source):
    second = 10**9
    time = 0.01 * np.arange(400)
    stamps = second + (time * second).astype(np.int64)
    source.signals.extend("command", stamps, np.sin(time)[:, None])
    source.signals.extend("measured", stamps, np.column_stack([np.sin(time), np.cos(time)]))
    assessed = Assessment(
        MODEL, "0 to 4 s", stamps, *[np.zeros((400, 2))] * 4, {}, Where(MODEL.name, "0 to 4 s", ())
    )  # fmt: skip
    source.state.change(assessment=assessed)
    source._coordinator.busy = "something else"
    late = stamps + 6 * second
    source.signals.extend("measured", late, np.zeros((400, 2)))
    source.work()
    assert not source._wanted, "nobody looks"
    source.state.look()
    source.work()
    assert list(source._wanted) == ["assess"]
    source._coordinator.busy = ""


def test_pictures_are_drawn_while_the_free_run_follows_the_data(monkeypatch):
    """On a busy machine the next free run was due before the last one had ended, and no picture was ever drawn."""
    source, ordered = LiveSource(MODEL, 5000, lambda: 20.0), []
    try:
        monkeypatch.setattr(source._coordinator, "order", lambda text, job, **_: ordered.append(text))
        stamps = 10**9 + 10**7 * np.arange(2000)
        source.signals.extend("measured", stamps, np.zeros((2000, 2)))
        source.signals.extend("command", stamps, np.zeros((2000, 1)))
        source.state.change(assessment=SimpleNamespace(stamps=stamps[:1]), missing=Missing("missing"))
        source.state.look()
        for wanted in ("assess", "pictures"):
            source.want(wanted)
        for _ in range(3):
            source.work()
        assert ordered == ["looking where the model fails", "characteristics", "looking where the model fails"]
    finally:
        source.close()
