"""A play that only the sensor sees, sampled so fast that one-step predictions hardly see it."""

import numpy as np
import pytest

from idloop.diagnosis import diagnose
from idloop.diagnosis.refine import _Refinement, refine
from idloop.physics import Model, load_model
from idloop.physics.simulation import simulate
from idloop.records import Record

from .conftest import axis_by_current, record_of

NOISE = 1e-3  # of the position [rad]


def recorded(machine: Model, rate: float, seconds: float) -> Record:
    rng = np.random.default_rng(2)
    time = np.arange(0.0, seconds, 1.0 / rate)
    command = 0.5 * rng.uniform(-1.0, 1.0, 200)[(time / 0.4).astype(int)] + 0.15 * np.sin(5.0 * time)
    noise = rng.normal(0.0, NOISE, (len(time), 1))
    position = simulate(machine, time, command, time, noise=noise).output
    return Record("run", time, command, time, position, "command", "A", ("axis.position",), ("rad",))


# The short form of `auto` is the diagnosis below.
@pytest.mark.parametrize("criterion", [pytest.param("auto", marks=pytest.mark.slow), "simulation"])
def test_a_play_that_the_free_run_shows_is_named(criterion: str) -> None:
    plain = axis_by_current(NOISE)
    record = recorded(plain.with_effects(["backlash@position[axis](gap=0.3)"]), 500.0, 14.0)
    assert len(record.time) > 5_000  # evaluated in a few samples first
    found = refine(plain, [record], criterion=criterion, effects=["backlash", "sensor_delay", "coulomb_friction"])
    assert found.added == ("backlash@position[axis]",)
    assert found.model.values["backlash@position[axis].gap"] == pytest.approx(0.3, rel=0.01)


def test_a_diagnosis_names_what_the_ladder_adds() -> None:
    plain = axis_by_current(NOISE)
    record = recorded(plain.with_effects(["backlash@position[axis](gap=0.3)"]), 500.0, 8.0)
    found = diagnose(plain, [record], effects=["backlash", "sensor_delay", "coulomb_friction"])
    assert (found.criterion, found.set) == ("simulation", ("backlash@position[axis]",))


@pytest.mark.parametrize("seed", [3, pytest.param(8, marks=pytest.mark.slow)])
def test_a_disturbance_with_a_memory_is_no_effect(seed: int) -> None:
    """It adds up in a free run to errors as slow as the record, which some effect always fits."""
    plain = load_model("axis")
    start = plain.with_values({p.name: 0.7 * p.value for p in plain.parameters if p.free})
    record = record_of(plain, seed, disturbance=0.03)
    effects = ["asymmetric_friction", "asymmetric_viscous_friction", "cable_spring"]
    assert refine(start, [record], effects=effects).added == ()
    assert diagnose(start, [record], effects=effects).best is None


def test_a_free_run_that_is_as_good_as_its_sensor_is_not_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    asked, climb = [], _Refinement._climb
    monkeypatch.setattr(_Refinement, "_climb", lambda self, view, kind: asked.append(kind) or climb(self, view, kind))
    refine(axis_by_current(NOISE), [recorded(axis_by_current(NOISE), 200.0, 10.0)], effects=["backlash"])
    assert "prediction" in asked
    assert "simulation" not in asked
