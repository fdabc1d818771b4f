"""The linear part of a controller answers as the compiled controller does within its limits."""

from __future__ import annotations

import numpy as np
import pytest

import control
from idloop.control import build_controller
from idloop.control.linear import linear_feedback
from idloop.errors import InputError

SPECS = (
    {"type": "p", "output": "motor.position", "kp": 2.0, "sample_time": 0.01},
    {
        "type": "pid", "output": "motor.position", "kp": 8.0, "ki": 3.0, "kd": 0.8, "derivative_filter": 0.02,
        "feedback_gain": 0.5, "linearisation": {"gain": 2.44, "offset": 0.04}, "limit": 1e3, "sample_time": 0.01,
    },
    {"type": "lead", "output": "motor.position", "gain": 3.0, "zero": 1.0, "pole": 20.0, "sample_time": 0.01},
    {
        "type": "cascade", "output": "motor.position", "velocity_output": "motor.velocity", "kp": 4.0, "kv": 0.3,
        "ki": 2.0, "velocity_limit": 1e3, "sample_time": 0.01,
    },
    {"type": "cascade", "output": "motor.position", "kp": 4.0, "kv": 0.3, "sample_time": 0.01},
    {
        "type": "state_feedback", "states": ["motor.position", "motor.velocity"], "differentiate": ["motor.velocity"],
        "gains": [3.0, 0.2], "sample_time": 0.01,
    },
)  # fmt: skip


@pytest.mark.parametrize("spec", SPECS, ids=lambda spec: spec["type"])
def test_it_subtracts_what_the_compiled_controller_subtracts(spec):
    controller = build_controller(spec)
    y = np.random.default_rng(3).normal(size=(60, len(controller.inputs)))
    # A first sample at rest starts the differences from there.
    y[0] = 0.0
    still = build_controller(spec)
    law = np.array([controller.step(0.0, 0.0, row) - still.step(0.0, 0.0, 0.0 * row) for row in y])
    systems = linear_feedback(spec)
    assert tuple(systems) == controller.inputs
    total = sum(control.forced_response(system, inputs=y[:, i]).outputs for i, system in enumerate(systems.values()))
    np.testing.assert_allclose(-total, law, rtol=1e-9, atol=1e-9)


def test_the_law_is_sampled_anew():
    spec = {"type": "pid", "output": "motor.position", "kp": 1.0, "ki": 2.0, "kd": 0.1, "sample_time": 0.001}
    (system,) = linear_feedback(spec, 0.01).values()
    assert system.dt == 0.01
    step = control.step_response(system, T=np.arange(4) * 0.01).outputs
    # Proportional, then the integral grows by ki Ts; the derivative of a step lasts one sample.
    np.testing.assert_allclose(step, [1.0 + 0.1 / 0.01, 1.02, 1.04, 1.06], rtol=1e-9)


@pytest.mark.parametrize(("spec", "words"), ((None, "no controller"), ({"type": "none"}, "no feedback")))
def test_no_feedback_is_one_clear_line(spec, words):
    with pytest.raises(InputError, match=words):
        linear_feedback(spec)
