"""The small pictures: what the data leave without an effect, and the fitted effect on it."""

from __future__ import annotations

import numpy as np
import pytest

from idloop.diagnose import Candidate
from idloop.physics import load_model, simulate
from idloop.records import Record
from idloop.workbench import assessment

DT = 0.01
WIDTH = 0.8
DEAD_ZONE = Candidate(
    "dead_zone", "input", "yes", "", "", p_value=0.001, parameters={"width": {"value": WIDTH, "stderr": 0.001}}
)
DRAG = Candidate(
    "quadratic_drag", "motor", "yes", "", "", p_value=0.6, parameters={"coefficient": {"value": 1e-3, "stderr": 1.0}}
)


@pytest.fixture(scope="module")
def record():
    """A motor with a dead zone under a command that changes size and sign."""
    model = load_model("dc_motor")
    rng = np.random.default_rng(3)
    time = DT * np.arange(2000)
    command = np.repeat(rng.uniform(-3.0, 3.0, 50), 40)
    clean = simulate(model.with_effects([f"dead_zone@input(width={WIDTH})"]), time, command, time).output
    return Record(
        "run", time, command, time, clean + rng.standard_normal(clean.shape) * [0.0332, 0.0728], "motor.effort", "V",
        tuple(model.output_names), tuple(o.unit for o in model.outputs), start_ns=10**9,
    )  # fmt: skip


@pytest.fixture
def model():
    """As it was fitted without the dead zone: with less gain than the motor has."""
    return load_model("dc_motor").with_values({"drive.gain": 5.4})


def draw(model, candidates, record):
    return assessment.draw_characteristics(model, candidates, record, lambda share, text: None)


def test_the_fitted_effect_lies_on_the_data_though_the_model_was_fitted_without_it(model, record):
    drawn = draw(model, [DEAD_ZONE], record)[DEAD_ZONE.name]
    line = np.interp(drawn.centre, drawn.curve_x, drawn.curve_y)
    assert np.max(np.abs(line - drawn.mean)) < 0.2, "of a command of 3 V"
    assert drawn.share > 0.9


def test_the_best_evidence_has_its_picture_first(model, record, monkeypatch):
    monkeypatch.setattr(assessment, "MOST_PICTURES", 1)
    assert list(draw(model, [DRAG, DEAD_ZONE], record)) == [DEAD_ZONE.name]
