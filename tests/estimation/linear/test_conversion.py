import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import control
from idloop.errors import InputError
from idloop.estimation.linear import LinearModel, c2d, d2c, d2d

HOLDS = ["zoh", "foh", "tustin"]
FREQUENCY = np.array([0.01, 0.5, 2.0, 7.0])


def random_plant(seed):
    rng = np.random.default_rng(seed)
    n, m, p = rng.integers(1, 5), rng.integers(1, 3), rng.integers(1, 3)
    a = rng.normal(size=(n, n))
    a *= 5.0 / max(np.max(np.abs(np.linalg.eigvals(a))), 1e-3)
    return control.ss(a, rng.normal(size=(n, m)), rng.normal(size=(p, n)), rng.normal(size=(p, m)))


@pytest.mark.parametrize("hold", HOLDS)
@given(seed=st.integers(0, 200))
def test_there_and_back(hold, seed):
    plant = random_plant(seed)
    back = d2c(c2d(plant, 0.1, hold), hold)
    assert back.isctime()
    for what in "ABCD":
        np.testing.assert_allclose(getattr(back, what), getattr(plant, what), rtol=1e-6, atol=1e-7)


@pytest.mark.parametrize("hold", HOLDS)
def test_integrators_stay_integrators(hold):
    plant = control.ss([[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]], [[1.0, 0.0]], [[0.0]])
    back = d2c(c2d(plant, 0.01, hold), hold)
    np.testing.assert_allclose(back.A, plant.A, atol=1e-9)
    np.testing.assert_allclose(back(1j * FREQUENCY), plant(1j * FREQUENCY), rtol=1e-6)


def test_motor_of_the_lehigh_thesis():
    motor = control.tf([8.2550], [1.0, 2.3060, 0.0])
    sampled = c2d(motor, 0.1)
    # b/a (T - (1 - exp(-a T))/a) and so on: the zero-order hold of b/(s (s + a)) in closed form.
    a, b, t = 2.3060, 8.2550, 0.1
    fade = np.exp(-a * t)
    np.testing.assert_allclose(sampled.den[0][0], [1.0, -1.0 - fade, fade], atol=1e-12)
    np.testing.assert_allclose(
        sampled.num[0][0][-2:], b / a**2 * np.array([a * t - 1.0 + fade, 1.0 - fade - a * t * fade]), atol=1e-12
    )
    back = d2c(sampled)
    assert isinstance(back, control.TransferFunction)
    np.testing.assert_allclose(back.den[0][0], [1.0, 2.3060, 0.0], atol=1e-9)


def test_first_order_hold_is_exact_for_lines():
    plant = control.ss([[-1.0, 2.0], [-3.0, -0.5]], [[1.0], [0.5]], [[1.0, 1.0]], [[0.3]])
    corners = np.array([0.0, 1.0, -0.5, 2.0, 0.0, 0.3])
    time = np.arange(6) * 0.2
    fine = np.linspace(0.0, 1.0, 5001)
    exact = control.forced_response(plant, fine, np.interp(fine, time, corners)).outputs[::1000]
    sampled = c2d(plant, 0.2, "foh")
    # The state of the sampled system holds back what the first corner adds.
    offset = control.forced_response(sampled, time, corners).outputs
    np.testing.assert_allclose(offset, exact, atol=1e-6)


def test_a_model_keeps_its_names_and_its_samples():
    plant = c2d(control.ss([[-1.0, 1.0], [0.0, -2.0]], [[0.0], [1.0]], [[1.0, 0.0]], [[0.0]]), 0.1)
    model = LinearModel(
        "n4sid", plant.A, plant.B, plant.C, plant.D, np.zeros((2, 1)), np.eye(1), 0.1, ("u",), ("V",),
        ("y",), ("rad",), 1, 1,
    )  # fmt: skip
    found = d2c(model)
    assert found.input_labels == ["u"]
    assert found.output_labels == ["y"]
    np.testing.assert_allclose(np.sort(found.poles().real), [-2.0, -1.0])
    twice = d2d(model, 0.2)
    np.testing.assert_allclose(np.sort(twice.poles().real), np.exp([-0.4, -0.2]))
    assert twice.dt == 0.2


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: d2c(control.tf([1.0], [1.0, 0.5], 0.1)), "pole -0.5 on the negative real axis"),
        (lambda: d2c(control.tf([1.0], [1.0, 0.5], 0.1), "foh"), "negative real axis"),
        (lambda: d2c(control.tf([1.0], [1.0, -0.5, 0.0], 0.1)), "1 poles at zero"),
        (lambda: d2c(control.tf([1.0], [1.0, 1.0], 0.1), "tustin"), "pole at -1"),
        (lambda: d2c(control.tf([1.0], [1.0, 1.0])), "sample time 0"),
        (lambda: d2c(control.tf([1.0], [1.0, 0.5], True)), "period in seconds"),
        (lambda: c2d(control.tf([1.0], [1.0, 0.5], 0.1), 0.2), "d2d changes"),
        (lambda: c2d(control.tf([1.0], [1.0, 0.5]), 0.0), "must be positive"),
        (lambda: c2d(control.tf([1.0], [1.0, 0.5]), 0.1, "euler"), 'hold "euler" is not known'),
        (lambda: d2c(3.0), "float cannot be converted"),
    ],
)
def test_what_cannot_be_converted(call, message):
    with pytest.raises(InputError, match=message) as caught:
        call()
    assert "\n" not in str(caught.value)
