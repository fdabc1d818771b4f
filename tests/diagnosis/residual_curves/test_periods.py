"""A force that repeats over the position with an unknown period."""

import numpy as np
import pytest
from tests.diagnosis.conftest import record_of

from idloop.diagnosis import diagnose
from idloop.diagnosis.residual_curves.periods import residual_period
from idloop.diagnosis.residual_curves.trial_curves import CURVES, CurveProposal
from idloop.diagnosis.residual_curves.unknown_structure import KNOTS
from idloop.estimation.likelihood.estimation_problem import prepare_estimation
from idloop.physics import Model, load_model

PERIOD, AMPLITUDE = 2.0 * np.pi / 7.5, 0.05


def repeating() -> Model:
    """The plain axis with seven and a half waves to the turn."""
    model = load_model("axis")
    width = PERIOD / (KNOTS - 1)
    curve = CurveProposal(CURVES["period"], model.bodies[0], model, low=0.0, width=width)
    wave = {f"knot{i}": AMPLITUDE * float(np.sin(2.0 * np.pi * i / (KNOTS - 1))) for i in range(KNOTS)}
    return curve.model(wave)


def test_the_period_of_a_remaining_force_is_found() -> None:
    model = load_model("axis")
    estimation = prepare_estimation(model, [record_of(repeating(), 5), record_of(repeating(), 6)], "prediction")
    found = residual_period(model, estimation)
    assert found is not None
    length, tried = found
    assert length == pytest.approx(PERIOD, rel=0.01)
    assert tried > 20


@pytest.mark.slow
def test_a_periodic_force_outside_the_catalogue_is_reported_with_its_period_and_strength(start: Model) -> None:
    diagnosis = diagnose(start, [record_of(repeating(), 5)], effects=["coulomb_friction"])
    assert diagnosis.verdict == "unknown_structure"
    unknown = diagnosis.unknown
    assert unknown is not None
    assert unknown.variable == "axis.position"
    assert unknown.period == pytest.approx(PERIOD, rel=0.01)
    assert unknown.at[-1] - unknown.at[0] == pytest.approx(unknown.period)
    assert unknown.along == "axis.position within a period"
    wave = unknown.force - np.mean(unknown.force[:-1])
    assert np.sqrt(2.0) * np.std(wave) == pytest.approx(AMPLITUDE, rel=0.15)
    assert "repeat every" in unknown.text
    assert "fitted force" in unknown.text


def test_too_short_a_travel_holds_no_period() -> None:
    model = load_model("axis").with_effects(["cable_spring@axis(stiffness=20.0)"])
    record = record_of(model, 5)
    assert np.ptp(record.output[:, 0]) < 1.0
    estimation = prepare_estimation(model, [record], "prediction")
    found = residual_period(model, estimation)
    assert found is None or found[0] < np.ptp(record.output[:, 0])
