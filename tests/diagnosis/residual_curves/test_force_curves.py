"""Curves that remain over velocity and time, as they are drawn and worded."""

from __future__ import annotations

import numpy as np
import pytest
from tests.diagnosis.conftest import record_of

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
