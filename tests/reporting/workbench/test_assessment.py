"""The small pictures: what the data leave without an effect, and the fitted effect on it."""

from __future__ import annotations

import numpy as np
import pytest

from idloop.diagnosis import Candidate
from idloop.physics import load_model, simulate
from idloop.records import Record
from idloop.reporting.workbench import assessment

DT = 0.01
WIDTH = 0.8
MODEL = load_model("dc_motor")
DEAD_ZONE = Candidate(
    "dead_zone", "input", "yes", "", "", p_value=0.001, model=MODEL.with_effects([f"dead_zone@input(width={WIDTH})"])
)
DRAG = Candidate(
    "quadratic_drag", "motor", "yes", "", "", p_value=0.6,
    model=MODEL.with_effects(["quadratic_drag@motor(coefficient=1e-3)"]),
)  # fmt: skip
SCREENED = Candidate("coulomb_friction", "motor", "yes", "", "", p_value=1e-9)


@pytest.fixture(scope="module")
def record():
    """A motor with a dead zone under a command that changes size and sign."""
    rng = np.random.default_rng(3)
    time = DT * np.arange(2000)
    command = np.repeat(rng.uniform(-3.0, 3.0, 50), 40)
    clean = simulate(MODEL.with_effects([f"dead_zone@input(width={WIDTH})"]), time, command, time).output
    return Record(
        "run", time, command, time, clean + rng.standard_normal(clean.shape) * [0.0332, 0.0728], "motor.effort", "V",
        tuple(MODEL.output_names), tuple(o.unit for o in MODEL.outputs), start_ns=10**9,
    )  # fmt: skip


def draw(candidates, record):
    return assessment.draw_characteristics(candidates, record, lambda share, text: None)


def test_the_fitted_effect_lies_on_the_data(record):
    drawn = draw([DEAD_ZONE], record)[DEAD_ZONE.name]
    line = np.interp(drawn.centre, drawn.curve_x, drawn.curve_y)
    assert np.max(np.abs(line - drawn.mean)) < 0.2, "of a command of 3 V"
    told = np.isfinite(drawn.mean)
    assert np.var(drawn.mean[told] - line[told]) < 0.1 * np.var(drawn.mean[told])


def test_beside_the_drive_force_stands_the_output_whose_residual_test_objects():
    """The position hides in its noise what the velocity shows."""
    rng = np.random.default_rng(1)
    time = DT * np.arange(2000)
    command = np.repeat(rng.uniform(-3.0, 3.0, 50), 40)
    machine = MODEL.with_effects(["coulomb_friction@motor(level=1.5)"])
    clean = simulate(machine, time, command, time).output + rng.standard_normal((2000, 2)) * [1.0, 0.02]
    units = tuple(o.unit for o in MODEL.outputs)
    record = Record("run", time, command, time, clean, "motor.effort", "V", MODEL.output_names, units)
    found = assessment.assess(MODEL, record, lambda share, text: None)
    calm, loud = (one.test for one in found.residual_tests)
    assert (calm.follows, calm.coloured) < (loud.follows, loud.coloured)
    assert found.looked_at("drive force") == found.looked_at("") == loud.name == "motor.velocity"
    assert found.looked_at(calm.name) == calm.name


def test_the_best_evidence_has_its_picture_first(record, monkeypatch):
    monkeypatch.setattr(assessment, "MOST_PICTURES", 1)
    assert list(draw([SCREENED, DRAG, DEAD_ZONE], record)) == [DEAD_ZONE.name]
