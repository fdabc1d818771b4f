"""Linear-quadratic design against closed forms and in closed loop."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.linalg import expm

from idloop.control import build_controller
from idloop.control.packing import linear_quadratic_gains

DOUBLE_INTEGRATOR = ([[0.0, 1.0], [0.0, 0.0]], [0.0, 1.0])


def test_double_integrator():
    # K = [sqrt(q/r), sqrt(2 sqrt(q/r))].
    gains = linear_quadratic_gains(*DOUBLE_INTEGRATOR, [9.0, 0.0], 1.0, None)
    assert gains == pytest.approx([3.0, math.sqrt(6.0)])


def test_discrete_design_tends_to_the_continuous_one():
    design = (*DOUBLE_INTEGRATOR, [9.0, 1.0], 2.0)
    continuous = linear_quadratic_gains(*design, None)
    coarse, fine = (np.max(np.abs(linear_quadratic_gains(*design, period) - continuous)) for period in (0.01, 0.001))
    assert fine < 0.11 * coarse < 0.01


@pytest.mark.parametrize("sample_time", [0.001, 0.1, 0.5])
def test_dc_motor_of_the_lehigh_thesis_settles_at_the_reference(sample_time):
    a, b = np.array([[0.0, 1.0], [0.0, -2.3060]]), np.array([0.0, 8.2550])
    controller = build_controller(
        {
            "type": "state_feedback",
            "states": ["motor.position", "motor.velocity"],
            "q": [100.0, 1.0],
            "r": 0.1,
            "model": {"a": a.tolist(), "b": b.tolist()},
            "sample_time": sample_time,
        }
    )
    together = expm(np.block([[a, b[:, None]], [np.zeros((1, 3))]]) * sample_time)
    x = np.zeros(2)
    for _ in range(round(20.0 / sample_time)):
        x = together[:2, :2] @ x + together[:2, 2] * controller.step(1.0, 0.0, x)
    assert x == pytest.approx([1.0, 0.0], abs=1e-6)
