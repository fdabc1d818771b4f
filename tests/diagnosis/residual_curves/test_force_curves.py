"""Curves that remain over velocity and time, as they are drawn and worded."""

from __future__ import annotations

import numpy as np
import pytest
from tests.diagnosis.conftest import record_of

from idloop.diagnosis import diagnose
from idloop.diagnosis.evidence.deciding_view import requested_force_fit
from idloop.diagnosis.evidence.predictive import scores_of
from idloop.diagnosis.residual_curves.force_curves import force_curves
from idloop.diagnosis.residual_curves.unknown_structure import Curve
from idloop.estimation.likelihood.estimation_problem import prepare_estimation
from idloop.physics import load_model


def test_a_remaining_force_is_drawn_as_the_fitted_model_leaves_it() -> None:
    machine = load_model("axis").with_effects(
        ["coulomb_friction@axis(level=0.3)", "quadratic_drag@axis(coefficient=0.02)"]
    )
    model = load_model("axis").with_effects(["coulomb_friction@axis(level=0.2)"])
    estimation = prepare_estimation(model, [record_of(machine, 5)], "force")
    fit = requested_force_fit(model, estimation, {})
    curve = next(one for one in force_curves(fit, scores_of(fit)) if one.of == "force" and one.variable == "velocity")
    drawn = curve.unknown(1e-9)
    velocity, residual = fit.form.motion.velocity[:, 0], fit.residual[:, 0]
    signals = (np.interp(velocity, drawn.at, drawn.force), velocity, np.sign(velocity))
    along, speed, sign = fit.form.weak(np.column_stack(signals)).T
    assert np.std(along) > 0.3 * np.std(residual), "the drag shows"
    # The curve is the mean of the residual: no other curve over these knots is nearer to it,
    assert abs(along @ (residual - along)) < 0.02 * float(along @ along)
    # and it has no part in viscous or dry friction, which the fit has taken.
    for taken in (speed, sign):
        part = abs(along @ taken) / np.linalg.norm(along) / np.linalg.norm(taken)
        assert part < 0.1, part


@pytest.mark.parametrize("over", ["time", "axis.position"])
def test_what_changes_with_the_time_may_be_the_frequency_of_a_sweep(over: str):
    curve = Curve("drive", "-", over, "s" if over == "time" else "rad", np.linspace(0.0, 9.0, 4), closed=False)
    found = curve.structure("the errors of the force", 1e-4, np.array([0.0, 0.1, 0.2, 0.3]), np.full(4, 0.01), 0.5)
    assert ("the frequency of a sweep" in found.text) is (over == "time")


@pytest.mark.parametrize(
    ("first", "second", "criterion", "of", "words"),
    [
        # By predictions a constant force is a disturbance.
        (
            "load_torque@axis(torque=0.05)",
            "load_torque@axis(torque=-0.05)",
            "force",
            "force",
            "a constant force differs",
        ),
        ("load_torque@axis(torque=0.0)", None, "force", "drive", "the drive differs between the records"),
        ("load_torque@axis(torque=0.0)", None, "prediction", "drive", "the drive differs between the records"),
        ("load_torque@axis(torque=0.02)", "load_torque@axis(torque=0.02)", "force", None, ""),
        ("load_torque@axis(torque=0.02)", "load_torque@axis(torque=0.02)", "prediction", None, ""),
    ],
)
def test_what_differs_between_records_is_said(
    first: str, second: str | None, criterion: str, of: str | None, words: str
) -> None:
    axis = load_model("axis")
    other = axis.with_values({"drive.gain": 0.8}) if second is None else axis.with_effects([second])
    records = [record_of(axis.with_effects([first]), 5), record_of(other, 6)]
    found = diagnose(axis, records, effects=["load_torque", "coulomb_friction"], criterion=criterion)
    if of is None:
        assert found.verdict != "unknown_structure"
        return
    assert found.unknown is not None
    assert (found.unknown.variable, found.unknown.of) == ("record", of)
    assert words in found.unknown.text
    size = 0.1 if of == "force" else 0.22
    assert np.ptp(found.unknown.force) == pytest.approx(size, rel=0.15)


def test_an_effect_is_found_beside_a_force_that_is_another_one_in_each_record() -> None:
    axis, friction = load_model("axis"), "coulomb_friction@axis(level=0.08)"
    loads = (f"load_torque@axis(torque={torque})" for torque in (0.1, -0.1))
    records = [record_of(axis.with_effects([load, friction]), seed) for seed, load in enumerate(loads, 5)]
    found = diagnose(axis, records, effects=["asymmetric_viscous_friction", "coulomb_friction"], criterion="force")
    assert found.set == ("coulomb_friction@axis",)
    assert found.unknown is None or found.unknown.variable == "record"
