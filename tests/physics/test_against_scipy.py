"""The compiled simulator against SciPy's solvers, and its order of convergence."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from idloop.physics import Model, load_model, simulate
from idloop.physics.engine import Engine
from idloop.physics.kernel import LEAST_SAMPLES

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


def chain_solution(model: Model, time: np.ndarray, command_time: np.ndarray, command: np.ndarray) -> np.ndarray:
    """Output of a linear model by SciPy's matrix exponential, from event to event."""
    from scipy.linalg import expm

    linear = Engine(model).linearise()
    states = len(linear.A)
    augmented = np.zeros((states + 1, states + 1))
    augmented[:states, :states], augmented[:states, states] = linear.A, linear.B
    x, out, now = np.zeros(states + 1), [], time[0]
    events = sorted([(t, 0, 0.0) for t in time] + [(t, 1, u) for t, u in zip(command_time, command, strict=True)])
    for t, kind, value in events:
        if t > time[-1]:
            break
        if t > now:
            x, now = expm(augmented * (t - now)) @ x, t
        if kind == 0:
            out.append(linear.C @ x[:states])
        else:
            x[states] = value
    return np.array(out)


@pytest.mark.parametrize("late", [0.0, 0.0007])
@pytest.mark.parametrize(("preset", "sample_time"), [("torsion", 0.005), ("lead_screw", 0.002)])
def test_a_chain_quicker_than_its_samples_is_exact(preset: str, sample_time: float, late: float) -> None:
    model = load_model(preset)
    time = np.arange(200) * sample_time
    command = np.repeat(np.random.default_rng(5).uniform(-1.0, 1.0, 20), 10)
    run = Engine(model).simulate(None, time + late, command, time)
    expected = chain_solution(model, time, time + late, command)
    # stamps in floating point are even to about 1e-8 of a step
    np.testing.assert_allclose(run, expected, atol=1e-6 * np.max(np.abs(expected)))


@pytest.mark.parametrize(
    ("name", "at", "values"),
    [
        ("coulomb_friction", "load2", {"level": 0.02}),
        ("stribeck_friction", "load1", {"coulomb": 0.02, "static": 0.03, "velocity": 0.5}),
        ("load_dependent_friction", "load1", {"ratio": 0.2}),
        ("quadratic_drag", "load3", {"coefficient": 1e-3}),
        ("cogging", "load1", {"amplitude": 0.02, "harmonic": 12.0, "phase": 0.3}),
        ("saturation", "input", {"limit": 2.0}),
        ("actuator_lag", "input", {"time_constant": 0.02}),
        ("backlash", "load1-load2", {"gap": 0.02}),
        ("compliance", "load3", {"stiffness": 3.0, "damping": 1e-3, "split": 0.5}),
    ],
)
def test_long_exact_steps_agree_with_short_ones(name: str, at: str, values: dict[str, float]) -> None:
    model = load_model("torsion").with_effect(name, at, **values)
    time = np.arange(500) * 0.004
    command = np.repeat(np.random.default_rng(5).uniform(-5.0, 5.0, 25), 20)
    engine = Engine(model)
    even = engine.simulate(None, time, command, time)
    # Stamps that are never even by a hair: every step is a short one.
    hair = time + 4e-8 * np.arange(500) % 3.7e-6
    short = engine.simulate(None, hair, command, hair)
    np.testing.assert_allclose(even, short, atol=1e-3 * np.max(np.abs(short)))


@pytest.mark.parametrize(
    "effects",
    [
        [],
        ["coulomb_friction@axis(level=0.1)"],
        ["cogging@axis(amplitude=0.05, harmonic=3)", "quadratic_drag@axis(coefficient=0.1)"],
    ],
)
def test_exact_steps_between_uneven_stamps_agree_with_runge_kutta_steps(effects):
    """A body that is much faster than its uneven stamps; a record of few samples has no exact steps."""
    model = load_model("axis").with_values({"axis.viscous_friction": 20.0}).with_effects(effects)
    rng = np.random.default_rng(0)
    time = np.cumsum(0.02 + 5e-4 * rng.standard_normal(LEAST_SAMPLES + 1))
    command = np.repeat(rng.uniform(-4.0, 4.0, LEAST_SAMPLES), 10)[: len(time)]
    exact = simulate(model, time, command, time).output[:-2]
    steps = simulate(model, time[:-2], command[:-2], time[:-2]).output
    np.testing.assert_allclose(exact, steps, atol=2e-5 * np.max(np.abs(steps)))
