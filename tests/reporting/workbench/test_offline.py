"""Recordings with a hidden effect: diagnosed, added and taken back by the page's own source, in its own process."""

from __future__ import annotations

import threading

import numpy as np
import pytest

pytest.importorskip("bokeh", reason="no Bokeh: launch_scripts/test installs it")

from idloop.errors import InputError
from idloop.physics import load_model, trust
from idloop.records import Record
from idloop.reporting.workbench.offline import OfflineSource
from idloop.reporting.workbench.signals import Signals
from idloop.reporting.workbench.state import page_state
from idloop.reporting.workbench.steps import Study

DT = 0.01


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


def settled(source, condition=lambda board: True, seconds=120.0):
    waited = threading.Event()
    for _ in range(int(seconds / 0.05)):
        board = source.board.snapshot
        if board.activity is None and not source._desk.busy and condition(board):
            return board
        waited.wait(0.05)
    raise AssertionError(f"not settled: {source.board.snapshot.note}")


@pytest.fixture
def source():
    kept = []
    study = Study((recorded(1),), (recorded(2),), effects=("coulomb_friction", "dead_zone", "quadratic_drag"))
    one = OfflineSource(load_model("dc_motor"), study, keep=kept.append)
    one.kept = kept
    yield one
    one.close()


@pytest.mark.slow
def test_the_page_climbs_to_the_hidden_effect_and_back(source):
    board = settled(source, lambda b: b.assessment is not None)
    assert board.recordings == ("run 2 (unseen)", "run 1 (fitted)")
    poor = board.assessment.fit["motor.velocity"]

    source.order("diagnose")
    with pytest.raises(InputError, match="under way"):
        source.order("diagnose")
    board = settled(source, lambda b: b.missing is not None)
    assert board.missing.set[0] == "coulomb_friction@motor"
    assert "coulomb_friction@motor" in board.pictures
    state = page_state(board, source.signals)
    card = state["missing"]["candidates"][0]
    assert card["best"]
    assert len(card["picture"]["curve"]) > 5
    assert state["assessment"]["telling"]["variable"] in {"velocity", "direction", "command", "since_reversal"}

    source.order("add", "coulomb_friction@motor")
    board = settled(source, lambda b: b.effects == ("coulomb_friction@motor",))
    errors = [step.validation["nrmse"]["motor.velocity"] for step in board.ladder.steps]
    assert errors[1] < 0.5 * errors[0]
    assert board.ladder.steps[1].chosen_by == "diagnosis"
    assert board.assessment.fit["motor.velocity"] > poor + 10.0
    assert board.missing is None

    source.order("undo")
    board = settled(source, lambda b: b.effects == ())
    assert len(board.ladder.steps) == 1
    assert [len(ladder.steps) for ladder in source.kept] == [1, 2, 1]
    with pytest.raises(InputError, match="nothing to undo"):
        source.order("undo")

    source.order("show", "1")
    board = settled(source, lambda b: b.shown == 1 and b.assessment is not None)
    assert board.assessment.record == "run 1"

    source.order("add", "no_such_effect@motor")
    board = settled(source, lambda b: b.note is not None)
    assert "no_such_effect" in board.note.text
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

from idloop.physics import Effect, ParameterSpec, hook

with Path(__file__).with_suffix(".log").open("a") as log:
    log.write("{}")


@hook
def force(position, velocity, inertia, elapsed, state, parameters):
    return parameters[0]


EFFECT = Effect("lean", "body", "It leans.", (ParameterSpec("size", "{{force}}"),), force=force)
"""


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
        settled(source, lambda board: board.assessment is not None)
        effect.write_text(LEAN.format("changed;"))
        source.order(*order)
        board = settled(source, lambda board: board.note is not None)
        assert "which have changed since they were trusted" in board.note.text
        assert board.effects == ()
        assert "changed" not in effect.with_suffix(".log").read_text()
    finally:
        source.close()
