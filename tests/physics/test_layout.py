"""The chain's matrix against the equation of motion, written with arrays."""

from __future__ import annotations

import numpy as np
import pytest

from idloop.physics import load_model
from idloop.physics.layout import lay_out


@pytest.mark.parametrize("preset", ["dc_motor", "lead_screw", "torsion"])
def test_the_matrix_of_a_chain_is_its_equation_of_motion(preset):
    model = load_model(preset)
    rng = np.random.default_rng(1)
    values = {name: value * np.exp(rng.normal()) for name, value in model.values.items()}
    axis = lay_out(model, values).axis
    n = len(axis.inertia)
    between = np.eye(n)[:-1] - np.eye(n)[1:]  # twist of each coupling for a displacement of each body
    stiff = between.T @ np.diag(axis.stiffness) @ between
    damp = np.diag(axis.viscous) + between.T @ np.diag(axis.damping) @ between
    mass = np.diag(axis.inertia)
    wanted = np.block([[np.zeros((n, n)), np.eye(n)], [-np.linalg.solve(mass, stiff), -np.linalg.solve(mass, damp)]])
    np.testing.assert_allclose(axis.chain, wanted, rtol=1e-12, atol=1e-12 * np.abs(wanted).max())
