"""Recordings with a hidden effect: diagnosed, added and taken back by the page's own source, in its own process."""

from __future__ import annotations

import threading

import numpy as np
import pytest

pytest.importorskip("bokeh", reason="no Bokeh: launch_scripts/test installs it")

from idloop.diagnosis import Candidate, Diagnosis
from idloop.diagnosis.evidence.detection_limit import DetectionLimit
from idloop.diagnosis.evidence.predictive import Course
from idloop.diagnosis.identifiability import Gate
from idloop.diagnosis.screening.command_response import CommandResponse
from idloop.errors import InputError
from idloop.physics import load_model, trust
from idloop.records import Record
from idloop.reporting.workbench import state_json
from idloop.reporting.workbench.offline import OfflineSource, recorded_evidence
from idloop.reporting.workbench.signals import Signals
from idloop.reporting.workbench.state import Snapshot
from idloop.reporting.workbench.state_json import page_state
from idloop.reporting.workbench.steps import Study, find_missing

DT = 0.01
FRICTION, ZONE = "coulomb_friction@motor", "dead_zone@input"


def recorded(seed, count=1200):
    """A motor with Coulomb friction under a square wave of changing size."""
    from idloop.physics import simulate

    model = load_model("dc_motor")
    machine = model.with_effects(["coulomb_friction@motor(level=2.0)"])
    rng = np.random.default_rng(seed)
    time = DT * np.arange(count)
    command = np.repeat(rng.uniform(-3.0, 3.0, count // 40), 40)
    clean = simulate(machine, time, command, time).output
    noise = rng.standard_normal(clean.shape) * [0.0332, 0.0728]
    return Record(
        f"run {seed}", time, command, time, clean + noise, "motor.effort", "V",
        tuple(model.output_names), tuple(o.unit for o in model.outputs), start_ns=10**9,
    )  # fmt: skip


def settled(source, condition=lambda shown: True, seconds=120.0):
    waited = threading.Event()
    for _ in range(int(seconds / 0.05)):
        shown = source.state.snapshot
        if shown.activity is None and not source._coordinator.busy and condition(shown):
            return shown
        waited.wait(0.05)
    raise AssertionError(f"not settled: {source.state.snapshot.note}")


@pytest.fixture
def source():
    kept = []
    study = Study((recorded(1),), (recorded(2),), effects=("coulomb_friction", "dead_zone", "quadratic_drag"))
    one = OfflineSource(load_model("dc_motor"), study, keep=kept.append)
    one.kept, one.computed = kept, []
    change = one.state.change

    def noted(**values):
        one.computed += [values["computing"]] if values.get("computing") else []
        change(**values)

    one.state.change = noted
    yield one
    one.close()


def test_a_ladder_of_the_page_ends_as_its_diagnosis_does(monkeypatch):
    model, record = load_model("dc_motor"), recorded(1, count=200)
    limit = DetectionLimit("level", "N·m", 0.1, 0.2)
    gate = Gate((), {}, {}, limits={"coulomb_friction@motor": limit})
    said = Diagnosis(
        model, (), (), "not_excited", gate, None, "force", 0.01, response=CommandResponse.UNMOVED
    )  # fmt: skip
    monkeypatch.setattr("idloop.diagnosis.diagnose", lambda *given, **options: said)
    found = find_missing(Study((record,)), model, None, lambda share, text: None)
    assert found.ladder.response is CommandResponse.UNMOVED
    assert found.ladder.limits == gate.limits
    # A record of a machine that the model is not of leaves more than noise, and the page is told.
    assert {one.test.name for one in found.left} == set(model.output_names)


@pytest.mark.parametrize(
    ("named", "refused", "decided", "said"),
    [
        ((FRICTION,), (), {FRICTION, ZONE}, "Coulomb friction @ motor is decided"),
        ((FRICTION,), (ZONE,), {FRICTION}, "Coulomb friction @ motor is decided"),
        ((FRICTION, ZONE), (), {FRICTION, ZONE}, "one of the 2 effects that tie is decided"),
        ((), (FRICTION,), set(), "no effect is decided in 1.99 s; the threshold is reached by 2 that are not added"),
    ],
)
def test_the_evidence_decides_no_effect_that_the_diagnosis_does_not_name(named, refused, decided, said):
    candidates = tuple(
        Candidate(name, at, "yes", "", "Some physics.", p_value=1e-9, course=Course((100, 200), (5.0, final)))
        for name, at, final in (
            ("coulomb_friction", "motor", 30.0),
            ("dead_zone", "input", 40.0),
            ("drag", "motor", 7.0),
        )
    )
    gate = Gate((), {}, {})
    found = Diagnosis(
        load_model("dc_motor"), candidates, named, "missing" if named else "adequate", gate, None, "force", 0.01,
        passed_over=dict.fromkeys(refused, "too small"), threshold=8.0,
    )  # fmt: skip
    evidence = recorded_evidence(found, [recorded(1, count=200)])
    assert set(evidence.decided) == decided
    assert evidence.line.startswith(said)
    rows = {row["name"]: row["decided"] for row in state_json._evidence(evidence, Snapshot())["effects"]}
    assert rows["drag@motor"] == "open"
    assert {name for name, text in rows.items() if text == "not added"} == set(rows) - decided - {"drag@motor"}


@pytest.mark.slow
def test_the_page_climbs_to_the_hidden_effect_and_back(source):
    shown = settled(source, lambda b: b.assessment is not None)
    assert shown.recordings == ("run 2 (unseen)", "run 1 (fitted)")
    poor = shown.assessment.errors["fit"]["motor.velocity"]

    source.order("diagnose")
    with pytest.raises(InputError, match="under way"):
        source.order("diagnose")
    shown = settled(source, lambda b: b.missing is not None)
    assert shown.missing.set[0] == "coulomb_friction@motor"
    assert "coulomb_friction@motor" in shown.pictures
    state = page_state(shown, source.signals)
    card = state["missing"]["candidates"][0]
    assert card["best"]
    assert len(card["picture"]["curve"]) > 5
    rows = {row["name"]: row for row in state["evidence"]["effects"]}
    best = shown.missing.candidates[0]
    assert best.course is not None
    assert rows[best.name]["log_e"] == f"{best.course.log_e[-1]:.1f}".replace("-", "−")
    assert rows[best.name]["decided"]
    assert state["evidence"]["current"]
    assert "Fits to the other stretches" in state["evidence"]["hint"]
    assert shown.evidence.seconds[-1] == pytest.approx(DT * 1199)
    assert state["assessment"]["telling"]["variable"] in {"velocity", "direction", "command", "since_reversal"}

    # The fit with which a diagnosis begins is said: what it changed is no part of what an effect changes.
    assert source.computed == ["start: fitted to run 1"]
    assert shown.given is not None
    assert shown.reason == "fitted to run 1 before effects were looked for"
    assert shown.reason in shown.note.text

    source.order("add", "quadratic_drag@motor")
    shown = settled(source, lambda b: b.effects == ("quadratic_drag@motor",))
    assert all(one.stderr is not None for one in shown.model.parameters if one.free)
    assert shown.reason.startswith("quadratic drag @ motor was added")
    assert shown.evidence is None  # of the model before
    assert shown.computing == ""
    source.order("undo")
    shown = settled(source, lambda b: b.effects == ())
    assert shown.reason == "the last step was taken back"
    source.order("diagnose")
    settled(source, lambda b: b.missing is not None)
    assert source.computed[1:] == ["+ quadratic drag @ motor", "the last step taken back"]

    source.order("add", "coulomb_friction@motor")
    shown = settled(source, lambda b: b.effects == ("coulomb_friction@motor",))
    errors = [step.validation["nrmse"]["motor.velocity"] for step in shown.ladder.steps]
    assert errors[1] < 0.5 * errors[0]
    assert shown.ladder.steps[1].chosen_by == "diagnosis"
    assert shown.assessment.errors["fit"]["motor.velocity"] > poor + 10.0
    assert shown.missing is None

    source.order("undo")
    shown = settled(source, lambda b: b.effects == ())
    assert len(shown.ladder.steps) == 1
    assert [len(ladder.steps) for ladder in source.kept] == [1, 2, 1, 1, 2, 1]
    with pytest.raises(InputError, match="nothing to undo"):
        source.order("undo")

    source.order("show", "1")
    shown = settled(source, lambda b: b.shown == 1 and b.assessment is not None)
    assert shown.assessment.record == "run 1"

    source.order("add", "no_such_effect@motor")
    shown = settled(source, lambda b: b.note is not None)
    assert "no_such_effect" in shown.note.text
    with pytest.raises(InputError, match="no motor"):
        source.order("reset")


def test_a_recording_is_shown_whole():
    record = recorded(3, 400)
    signals = Signals(load_model("dc_motor"), capacity=400)
    signals.load(record)
    time, values = signals.view(*signals.span, 10_000).points["measured"]
    assert time == pytest.approx(record.time)
    assert values == pytest.approx(record.output)


LEAN = """\
from pathlib import Path

from idloop.physics import Effect, EffectParameter, hook

with Path(__file__).with_suffix(".log").open("a") as log:
    log.write("{}")


@hook
def force(position, velocity, inertia, elapsed, state, parameters):
    return parameters[0]


EFFECT = Effect("lean", "body", "It leans.", (EffectParameter("size", "{{force}}"),), force=force)
"""


@pytest.mark.slow
@pytest.mark.parametrize("order", [("add", "lean@motor"), ("diagnose", "")])
def test_the_page_runs_no_effect_that_was_changed_since_it_was_trusted(order, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    effect = tmp_path / "effects" / "lean.py"
    effect.parent.mkdir()
    effect.write_text(LEAN.format("trusted;"))
    load_model("dc_motor").save(tmp_path / "model.yaml")
    trust.trust(trust.read_effect_files(effect.parent))
    source = OfflineSource(load_model(tmp_path / "model.yaml"), Study((recorded(1, 400),), effects=("lean",)))
    try:
        settled(source, lambda shown: shown.assessment is not None)
        effect.write_text(LEAN.format("changed;"))
        source.order(*order)
        shown = settled(source, lambda shown: shown.note is not None)
        assert "which have changed since they were trusted" in shown.note.text
        assert shown.effects == ()
        assert "changed" not in effect.with_suffix(".log").read_text()
    finally:
        source.close()
