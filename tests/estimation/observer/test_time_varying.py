import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.linalg import expm, solve_discrete_are

from idloop.estimation.observer.time_varying import time_varying_observer
from idloop.physics import Engine, load_model
from idloop.physics.engine import Linear

STEP = 0.01
# So many samples that the gain is held only when hardly anything is left to settle.
ENDLESS = 10**7


def augmented(linear: Linear, intensity: float, decay: float) -> tuple[np.ndarray, np.ndarray]:
    """Transition and process noise of the motion with a force that is held, forgotten and renewed at each sample."""
    n = len(linear.A)
    rates, noise = np.zeros((n + 1, n + 1)), np.zeros((n + 1, n + 1))
    rates[:n, :n], rates[:n, n] = linear.A, linear.G
    transition = expm(STEP * rates)
    transition[n, n], noise[n, n] = decay, STEP * intensity
    return transition, noise


@pytest.mark.parametrize("decay", [1.0, 0.9, 0.0])
@pytest.mark.parametrize(
    ("name", "measured"), [("dc_motor", [0, 1]), ("dc_motor", [0]), ("axis", [0, 1]), ("torsion", [0, 3])]
)
@settings(max_examples=5)
@example(exponent=1.9375)
@given(exponent=st.floats(-2.0, 2.0))
def test_it_settles_at_the_steady_kalman_gain(name: str, measured: list[int], decay: float, exponent: float) -> None:
    model = load_model(name)
    linear = Engine(model).linearise()
    n, noise = len(linear.A), np.array([o.noise for o in model.outputs])
    found = time_varying_observer(linear, measured, STEP, 10.0**exponent, noise, np.ones(n + 1), ENDLESS, decay)
    transition, process = augmented(linear, 10.0**exponent, decay)
    output = np.hstack([linear.C[measured], np.zeros((len(measured), 1))])
    spread = solve_discrete_are(transition.T, output.T, process, np.diag(noise[measured] ** 2))
    innovation = output @ spread @ output.T + np.diag(noise[measured] ** 2)
    gain = np.zeros((n + 1, len(noise)))
    gain[:, measured] = spread @ output.T @ np.linalg.inv(innovation)
    # It is held by what is left to settle of its largest element: small ones are as exact as that one.
    assert found.gain[-n - 1 :] == pytest.approx(gain, rel=1e-4, abs=1e-5 * np.max(np.abs(gain)))
    assert found.covariance[-1][np.ix_(measured, measured)] == pytest.approx(innovation, rel=1e-4)


@given(decay=st.floats(0.0, 1.0), seed=st.integers(0, 1000))
def test_the_first_gains_are_those_of_the_textbook_recursion(decay: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    linear = Engine(load_model("dc_motor")).linearise()
    noise, start, intensity = rng.uniform(0.01, 1.0, 2), rng.uniform(0.1, 10.0, 3), float(rng.uniform(0.1, 10.0))
    found = time_varying_observer(linear, [0, 1], STEP, intensity, noise, start, 8, decay)
    transition, process = augmented(linear, intensity, decay)
    output = np.hstack([linear.C, np.zeros((2, 1))])
    spread = np.diag(start**2)
    for k in range(found.steps):
        innovation = output @ spread @ output.T + np.diag(noise**2)
        gain = spread @ output.T @ np.linalg.inv(innovation)
        assert found.gain[3 * k : 3 * k + 3] == pytest.approx(gain, rel=1e-6, abs=1e-12)
        assert found.covariance[k] == pytest.approx(innovation, rel=1e-6)
        spread = transition @ (spread - gain @ output @ spread) @ transition.T + process
    assert found.steps >= 5


def test_a_position_that_no_sensor_sees_leaves_the_gains_accurate() -> None:
    # Two bodies on a spring by the velocity of the first: where the axis stands is unknown, and makes no difference.
    model = load_model("axis").with_effects(["compliance@axis(stiffness=9.0, damping=0.03, split=0.33)"])
    linear = Engine(model).linearise()
    (velocity,) = np.flatnonzero([one.name == "axis.velocity" for one in model.outputs])
    noise, start = np.full(len(linear.C), 0.02), np.array([1.0, 1.0, 100.0, 100.0, 1.0])
    found = [
        time_varying_observer(linear, [velocity], 0.002, 1e-6, noise, start * [far, far, 1, 1, 1], 10_000, 0.2)
        for far in (1.0, 1e4)
    ]
    assert all(np.all(np.isfinite(one.gains)) for one in found)
    last = [one.covariance[-1][velocity, velocity] for one in found]
    assert last[0] == pytest.approx(last[1], rel=1e-6)
    assert last[0] >= noise[velocity] ** 2


def test_a_spring_seen_by_the_velocity_of_the_motor_alone_has_an_observer_at_any_disturbance() -> None:
    model = load_model("axis").with_effects(["compliance@axis(stiffness=30.0, damping=0.01, split=0.57)"])
    linear = Engine(model.with_values({"axis.inertia": 0.007, "axis.viscous_friction": 0.03})).linearise()
    (velocity,) = np.flatnonzero([one.name == "axis.velocity" for one in model.outputs])
    noise, start = np.full(len(linear.C), 0.01), np.array([200.0, 200.0, 200.0, 200.0, 1e-6])
    for intensity, decay in ((3e-3, 4.5e-5), (1.2e-6, 0.9), (1.2e-8, 0.2)):
        found = time_varying_observer(linear, [velocity], 0.001, intensity, noise, start, 10_000, decay)
        assert np.all(np.isfinite(found.gains))
