"""The compiled simulator against SciPy's solvers, and its order of convergence."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from idloop.physics import Model, load_model, simulate

TIME = np.arange(0.0, 5.0, 0.02)
COMMAND = np.random.default_rng(3).uniform(-1.0, 1.0, len(TIME))


def solve(acceleration, states: int, time=TIME, command=COMMAND) -> np.ndarray:
    """Integrate piecewise, interval by interval of the held command, to 1e-11."""
    x = np.zeros(2 * states)
    out = [x]
    for k in range(len(time) - 1):

        def rate(t, x, u=command[k]):
            return np.concatenate([x[states:], acceleration(x[:states], x[states:], u)])

        x = solve_ivp(rate, (time[k], time[k + 1]), x, method="DOP853", rtol=1e-11, atol=1e-12).y[:, -1]
        out.append(x)
    return np.array(out)


@pytest.fixture
def pendulum() -> Model:
    model = load_model("axis").with_values({"axis.inertia": 0.1, "axis.viscous_friction": 0.05})
    return (
        model.with_effect("imbalance", "axis", amplitude=0.8, phase=0.3)
        .with_effect("quadratic_drag", "axis", coefficient=0.02)
        .with_effect("cogging", "axis", amplitude=0.1, harmonic=6, phase=0.0)
    )


def pendulum_acceleration(x, v, u):
    drag = 0.05 * v + 0.02 * np.abs(v) * v
    return (u - drag - 0.8 * np.sin(x + 0.3) - 0.1 * np.sin(6 * x)) / 0.1


def test_smooth_effects_agree(pendulum: Model) -> None:
    run = simulate(pendulum, TIME, COMMAND, TIME)
    expected = solve(pendulum_acceleration, 1)
    np.testing.assert_allclose(run.output, expected, atol=2e-5 * np.max(np.abs(expected)))


def test_four_bodies_with_hardening_agree() -> None:
    model = load_model("torsion").with_effect("hardening_stiffness", "load1-load2", cubic=4.0)
    run = simulate(model, TIME, COMMAND, TIME)
    inertia = np.array([3.11e-5, 5.46e-4, 5.46e-4, 5.46e-4])
    viscous = np.array([2e-3, 5e-4, 5e-4, 5e-4])

    def acceleration(x, v, u):
        torque = (x[:-1] - x[1:]) + 1e-3 * (v[:-1] - v[1:])
        torque[1] += 4.0 * (x[1] - x[2]) ** 3
        force = -viscous * v
        force[0] += 0.0742 * u
        force[:-1] -= torque
        force[1:] += torque
        return force / inertia

    expected = solve(acceleration, 4)[:, :4]
    np.testing.assert_allclose(run.output, expected, atol=5e-5 * np.max(np.abs(expected)))


def test_error_falls_with_the_fourth_power_of_the_step(pendulum: Model, monkeypatch: pytest.MonkeyPatch) -> None:
    from idloop.physics import layout

    time = np.arange(0.0, 4.0, 0.8)
    command = COMMAND[: len(time)]
    model = pendulum.without_effect("quadratic_drag@axis")  # its third derivative jumps

    def acceleration(x, v, u):
        return (u - 0.05 * v - 0.8 * np.sin(x + 0.3) - 0.1 * np.sin(6 * x)) / 0.1

    expected = solve(acceleration, 1, time, command)
    errors = []
    for angle in (0.2, 0.1, 0.05, 0.025):
        monkeypatch.setattr(layout, "STEP_ANGLE", angle)
        errors.append(np.max(np.abs(simulate(model, time, command, time).output - expected)))
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert np.all(orders > 3.0), (errors, orders)
    assert np.mean(orders) > 3.6, (errors, orders)


def test_friction_events_do_not_spoil_the_order() -> None:
    """Dry friction with reversals, solved piecewise between exact events."""
    model = load_model("axis").with_values({"axis.inertia": 0.1, "axis.viscous_friction": 0.05})
    model = model.with_effect("coulomb_friction", "axis", level=0.2)
    run = simulate(model, TIME, COMMAND, TIME)
    x = v = 0.0
    expected = [(x, v)]
    for k in range(len(TIME) - 1):
        left, u = TIME[k + 1] - TIME[k], COMMAND[k]
        while left > 0.0:
            direction = np.sign(v) if v != 0.0 else np.sign(u) * (abs(u) > 0.2)
            if direction == 0.0:
                break
            end = (u - 0.2 * direction) / 0.05  # speed that viscous friction would settle at
            stop = 2.0 * np.log((v - end) / -end) if v * end < 0.0 else np.inf
            step = min(left, stop)
            x += end * step + (v - end) * 2.0 * (1.0 - np.exp(-step / 2.0))
            v = end + (v - end) * np.exp(-step / 2.0) if stop > left else 0.0
            left -= step
        expected.append((x, v))
    np.testing.assert_allclose(run.output, expected, atol=1e-9)
