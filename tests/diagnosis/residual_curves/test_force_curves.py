"""A force over the velocity that remains, as it is drawn."""

from __future__ import annotations

import numpy as np
from tests.diagnosis.conftest import record_of

from idloop.diagnosis.evidence.deciding_view import requested_force_fit
from idloop.diagnosis.residual_curves.force_curves import force_curves
from idloop.estimation.likelihood.estimation_problem import prepare_estimation
from idloop.physics import load_model


def test_a_remaining_force_is_drawn_as_the_fitted_model_leaves_it() -> None:
    machine = load_model("axis").with_effects(
        ["coulomb_friction@axis(level=0.3)", "quadratic_drag@axis(coefficient=0.02)"]
    )
    model = load_model("axis").with_effects(["coulomb_friction@axis(level=0.2)"])
    estimation = prepare_estimation(model, [record_of(machine, 5)], "force")
    fit = requested_force_fit(model, estimation, {})
    curve = next(one for one in force_curves(fit) if one.of == "force" and one.variable == "velocity")
    drawn = curve.unknown(1e-9)
    speed, residual = fit.form.along("velocity"), fit.residual[:, 0]
    along = np.interp(speed, drawn.at, drawn.force)
    assert np.std(along) > 0.3 * np.std(residual), "the drag shows"
    # The curve is the mean of the residual: no other curve over these knots is nearer to it,
    assert abs(along @ (residual - along)) < 0.02 * float(along @ along)
    # and it has no part in viscous or dry friction, which the fit has taken.
    for taken in (speed, np.sign(speed)):
        part = abs(along @ taken) / np.linalg.norm(along) / np.linalg.norm(taken)
        assert part < 0.1, part
