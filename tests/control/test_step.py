"""The laws of the compiled controllers against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numba import njit
from scipy.signal import bilinear, lfilter

from idloop.control import build_controller
from idloop.control.step import controller_step

POSITION = "motor.position"


def run(spec, reference, measured, reference_velocity=None):
    """Commands of a controller with one input, sample by sample."""
    controller = build_controller(spec)
    velocity = np.zeros(len(reference)) if reference_velocity is None else reference_velocity
    return np.array([controller.step(r, v, [y]) for r, v, y in zip(reference, velocity, measured, strict=True)])


def test_p_controller_of_the_response_test():
    # Lehigh thesis, section 6.2: P 0.1684 on reference minus 0.1745 times the measurement.
    spec = {
        "type": "p",
        "output": POSITION,
        "kp": 0.1684,
        "feedback_gain": 0.1745,
        "sample_time": 0.1,
    }
    assert build_controller(spec).step(1.5, 0.0, [2.0]) == pytest.approx(0.1684 * (1.5 - 0.1745 * 2.0))


def test_pid_on_a_ramp():
    kp, ki, kd, period = 8.3867, 0.3255, 0.8, 0.001
    spec = {"type": "pid", "output": POSITION, "kp": kp, "ki": ki, "kd": kd, "sample_time": period}
    k = np.arange(2000)
    # Reference ramp: the integral is the sum of all earlier errors, and the derivative sees nothing.
    got = run(spec, 3.0 * k * period, np.zeros(2000))
    assert np.allclose(got, kp * 3.0 * k * period + ki * 3.0 * period**2 * k * (k - 1) / 2)
    # Output ramp: the derivative is the slope from the second sample on.
    got = run(spec, np.zeros(2000), 3.0 * k * period)
    expected = -kp * 3.0 * k * period - ki * 3.0 * period**2 * k * (k - 1) / 2 - kd * 3.0 * (k > 0)
    assert np.allclose(got, expected)


def test_pid_converges_to_the_continuous_law():
    # r = sin t, y = 0.5 sin t: u = 0.5 kp sin t + 0.5 ki (1 - cos t) - 0.5 kd cos t.
    errors = []
    for period in (0.01, 0.005):
        spec = {
            "type": "pid",
            "output": POSITION,
            "kp": 2.0,
            "ki": 1.5,
            "kd": 0.7,
            "sample_time": period,
        }
        time = np.arange(round(5.0 / period)) * period
        got = run(spec, np.sin(time), 0.5 * np.sin(time))
        exact = np.sin(time) + 0.75 * (1.0 - np.cos(time)) - 0.35 * np.cos(time)
        errors.append(np.max(np.abs(got - exact)[1:]))
    assert errors[0] < 0.02
    assert errors[1] == pytest.approx(errors[0] / 2, rel=0.1)


def test_filtered_derivative_is_a_first_order_high_pass():
    period, constant = 0.001, 0.02
    spec = {
        "type": "pd",
        "output": POSITION,
        "kp": 0.0,
        "kd": 1.0,
        "derivative_filter": constant,
        "sample_time": period,
    }
    measured = np.concatenate([[0.0], np.ones(200)])
    got = run(spec, np.zeros(201), measured)
    a = constant / (constant + period)
    expected = -lfilter([1.0, -1.0], [constant + period, -constant], measured)
    assert np.allclose(got, expected)
    assert got[2] / got[1] == pytest.approx(a)


def test_velocity_feedforward_equal_to_kd_puts_the_derivative_on_the_error():
    spec = {
        "type": "pd",
        "output": POSITION,
        "kp": 3.0,
        "kd": 0.5,
        "velocity_feedforward": 0.5,
        "sample_time": 0.01,
    }
    time = np.arange(100) * 0.01
    got = run(spec, 2.0 * time, 2.0 * time, np.full(100, 2.0))
    assert np.allclose(got[1:], 0.0)


def test_velocity_output_follows_the_reference_velocity():
    spec = {
        "type": "pid",
        "output": "motor.velocity",
        "kp": 2.0,
        "ki": 10.0,
        "sample_time": 0.01,
    }
    got = run(spec, np.full(3, 99.0), np.full(3, 0.5), np.full(3, 1.5))
    assert got == pytest.approx([2.0, 2.1, 2.2])


@given(
    gain=st.floats(0.01, 5.0) | st.floats(-5.0, -0.01),
    zero=st.floats(0.0, 50.0),
    pole=st.floats(0.1, 200.0),
    period=st.sampled_from([0.1, 0.01, 0.001]),
)
def test_lead_is_tustins_discretisation(gain, zero, pole, period):
    spec = {
        "type": "lead",
        "output": POSITION,
        "gain": gain,
        "zero": zero,
        "pole": pole,
        "sample_time": period,
    }
    error = np.random.default_rng(1).standard_normal(100)
    numerator, denominator = bilinear([gain, gain * zero], [1.0, pole], fs=1.0 / period)
    expected = lfilter(numerator, denominator, error)
    assert np.allclose(run(spec, error, np.zeros(100)), expected, atol=1e-9)


def test_cascade_closed_form_with_measured_velocity():
    spec = {
        "type": "cascade",
        "output": "load.position",
        "velocity_output": "motor.velocity",
        "kp": 4.0,
        "kv": 2.0,
        "ki": 10.0,
        "velocity_feedforward": 1.0,
        "velocity_limit": 3.0,
        "sample_time": 0.01,
    }
    controller = build_controller(spec)
    assert controller.inputs == ("load.position", "motor.velocity")
    error = 4.0 * (1.0 - 0.5) + 0.25 - 0.75
    assert controller.step(1.0, 0.25, [0.5, 0.75]) == pytest.approx(2.0 * error)
    assert controller.step(1.0, 0.25, [0.5, 0.75]) == pytest.approx(2.0 * error + 0.1 * error)
    controller.reset()
    assert controller.step(100.0, 0.0, [0.0, 1.0]) == pytest.approx(2.0 * (3.0 - 1.0))


@pytest.mark.parametrize("estimate", ["backward", "mean"])
def test_cascade_estimates_the_slope_of_a_ramp(estimate):
    spec = {
        "type": "cascade",
        "output": POSITION,
        "kp": 0.0,
        "kv": 1.0,
        "velocity_estimate": estimate,
        "sample_time": 0.01,
    }
    ramp = np.arange(10) * 0.02
    got = run(spec, np.zeros(10), ramp)
    # The mean of two samples needs one sample more to know the slope.
    assert got[:2] == pytest.approx([0.0, -2.0 if estimate == "backward" else -1.0])
    assert np.allclose(got[2:], -2.0)


def test_cascade_velocity_filter_is_a_low_pass():
    spec = {
        "type": "cascade",
        "output": POSITION,
        "velocity_output": "motor.velocity",
        "kp": 0.0,
        "kv": 1.0,
        "velocity_filter": 0.05,
        "sample_time": 0.01,
    }
    controller = build_controller(spec)
    velocity = np.concatenate([[0.0], np.ones(50)])
    got = np.array([controller.step(0.0, 0.0, [0.0, v]) for v in velocity])
    assert np.allclose(got, -lfilter([0.01 / 0.06], [1.0, -0.05 / 0.06], velocity))


def test_state_feedback_differentiates_where_asked():
    spec = {
        "type": "state_feedback",
        "states": ["motor.position", "load.position", "motor.velocity", "load.effort"],
        "differentiate": ["motor.velocity"],
        "gains": [1.0, 10.0, 100.0, 1000.0],
        "sample_time": 0.5,
    }
    controller = build_controller(spec)
    assert controller.inputs == ("motor.position", "load.position", "load.effort")
    assert controller.step(2.0, 3.0, [0.5, 1.0, 0.25]) == pytest.approx(1.5 + 10.0 + 100.0 * 3.0 - 250.0)
    assert controller.step(2.0, 3.0, [1.0, 1.0, 0.25]) == pytest.approx(1.0 + 10.0 + 100.0 * (3.0 - 1.0) - 250.0)


def test_linearisation_makes_the_offset_model_linear():
    # Linköping thesis: I = 2.44 u + 0.0397, so the current is the law's output, excitation included.
    spec = {
        "type": "p",
        "output": POSITION,
        "kp": 2.0,
        "sample_time": 0.001,
        "linearisation": {"gain": 2.44, "offset": 0.0397},
    }
    command = build_controller(spec).step(1.0, 0.0, [0.75], feedforward=0.1)
    assert command == pytest.approx((0.6 - 0.0397) / 2.44)
    assert 2.44 * command + 0.0397 == pytest.approx(0.6)


def windup_spec(mode, **more):
    return {
        "type": "pid",
        "output": POSITION,
        "kp": 1.0,
        "ki": 5.0,
        "limit": 1.0,
        "sample_time": 0.01,
        "anti_windup": mode,
        **more,
    }


@pytest.mark.parametrize("more", [{}, {"linearisation": {"gain": -2.0, "offset": 0.3}}])
def test_anti_windup_recovers_when_the_error_turns(more):
    # Ten seconds at the limit, then the error changes its sign.
    reference = np.concatenate([np.full(1000, 3.0), np.full(1000, -0.1)])

    def samples_at_old_limit(mode):
        commands = run(windup_spec(mode, **more), reference, np.zeros(2000))
        assert abs(commands[999]) == 1.0
        left = np.flatnonzero(commands[1000:] != commands[999])
        return int(left[0]) if left.size else 1000

    assert samples_at_old_limit("back_calculation") == 0
    assert samples_at_old_limit("conditional") == 0
    assert samples_at_old_limit("none") == 1000


@pytest.mark.parametrize("mode", ["back_calculation", "conditional"])
def test_anti_windup_does_nothing_below_the_limit(mode):
    reference = np.sin(np.arange(500) * 0.03)
    free = run(windup_spec("none", limit=50.0), reference, np.zeros(500))
    assert np.max(np.abs(free)) < 50.0
    assert np.array_equal(run(windup_spec(mode, limit=50.0), reference, np.zeros(500)), free)


def test_closed_loop_with_integral_reaches_the_reference_in_spite_of_the_limit():
    # First-order plant dx/dt = u - x under a step that keeps the command limited for a while.
    overshoot = {}
    for mode in ("back_calculation", "conditional", "none"):
        controller = build_controller(windup_spec(mode, kp=5.0))
        x, peak = 0.0, 0.0
        for _ in range(3000):
            u = controller.step(0.95, 0.0, [x])
            x += (u - x) * (1.0 - math.exp(-0.01))
            peak = max(peak, x)
        assert x == pytest.approx(0.95, abs=1e-3)
        overshoot[mode] = peak - 0.95
    assert overshoot["back_calculation"] < 0.5 * overshoot["none"]
    assert overshoot["conditional"] < 0.5 * overshoot["none"]


@njit
def compiled_loop(kind, parameters, state, steps):
    """Closed loop around an integrator, without leaving compiled code."""
    y = np.zeros(1)
    commands = np.empty(steps)
    for k in range(steps):
        commands[k] = controller_step(kind, parameters, state, 1.0, 0.0, y, 0.01)
        y[0] += 0.01 * commands[k]
    return commands


def test_the_same_step_runs_inside_compiled_loops():
    spec = windup_spec("back_calculation", kp=2.0)
    controller = build_controller(spec)
    kernel = controller.kernel
    got = compiled_loop(kernel.kind, kernel.parameters, kernel.state.copy(), 500)
    y, expected = 0.0, []
    for _ in range(500):
        expected.append(controller.step(1.0, 0.0, [y], feedforward=0.01))
        y += 0.01 * expected[-1]
    assert np.array_equal(got, expected)
    assert not np.any(kernel.state)


def test_feedforward_may_be_left_out():
    kernel = build_controller({"type": "p", "output": POSITION, "kp": 2.0, "sample_time": 0.1}).kernel
    y = np.array([0.5])
    assert controller_step(kernel.kind, kernel.parameters, kernel.state.copy(), 1.0, 0.0, y) == 1.0
