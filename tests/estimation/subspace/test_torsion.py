"""Table B.1 of the Linköping thesis, simulated: a motor and three loads on springs, one current, four angles."""

import numpy as np
import pytest
from numba import njit
from scipy.signal import butter, sosfilt

import control
from idloop.estimation.black_box.sampled import SampledData
from idloop.estimation.linear import c2d, prediction_error
from idloop.estimation.subspace import cva, moesp, n4sid, pbsid, vodma, vodma_direct

STEP, SAMPLES = 0.01, 8000
NAMES = ("motor", "load1", "load2", "load3")
# The thesis's gains hold at 1 kHz; at the data's 100 Hz the derivative has to be smaller.
PROPORTIONAL, DERIVATIVE = 2.0, 0.04


def plant():
    """Eq. 2.1 to 2.4 with A[5, 2] = k/Jm."""
    motor, load, stiffness, torque = 3.11e-5, 5.46e-4, 1.0, 0.0742
    inertia = np.array([motor, load, load, load])
    springs = stiffness * np.array([[1, -1, 0, 0], [-1, 2, -1, 0], [0, -1, 2, -1], [0, 0, -1, 1]])
    a = np.block(
        [
            [np.zeros((4, 4)), np.eye(4)],
            [-springs / inertia[:, None], -np.diag([2e-3, 5e-4, 5e-4, 5e-4] / inertia)],
        ]
    )
    b = np.zeros((8, 1))
    b[4] = torque / motor
    return c2d(control.ss(a, b, np.eye(4, 8), np.zeros((4, 1))), STEP)


@njit(cache=False)
def run(a, b, reference, noise, proportional, derivative, limit):
    x, before = np.zeros(8), 0.0
    u, y = np.zeros((len(reference), 1)), np.zeros((len(reference), 4))
    for k in range(len(reference)):
        y[k] = x[:4] + noise[k]
        command = reference[k] - proportional * y[k, 0] - derivative * (y[k, 0] - before)
        before = y[k, 0]
        u[k, 0] = min(max(command, -limit), limit)
        x = a @ x + b * u[k, 0]
    return u, y


def experiment(seed, noise=0.0, limit=1e9, closed=True):
    """Random Gaussian reference below 10 Hz, two deviations of 60 degrees; noise in degrees."""
    rng = np.random.default_rng(seed)
    reference = sosfilt(butter(5, 10.0, fs=1 / STEP, output="sos"), rng.normal(size=SAMPLES + 500))[500:]
    reference *= np.deg2rad(30.0) / reference.std()
    system = plant()
    u, y = run(
        system.A,
        system.B[:, 0].copy(),
        PROPORTIONAL * reference if closed else 0.5 * reference,
        np.deg2rad(noise) * rng.normal(size=(SAMPLES, 4)),
        PROPORTIONAL if closed else 0.0,
        DERIVATIVE / STEP if closed else 0.0,
        limit,
    )
    return SampledData("torsion", u, y, STEP, ("current",), ("A",), NAMES, ("rad",) * 4)


def fit(model, data):
    """Mean FIT of the free run in percent (eq. 4.3)."""
    error = np.linalg.norm(data.output - model.simulate(data), axis=0)
    return 100.0 * float(np.mean(1.0 - error / np.linalg.norm(data.output - data.output.mean(axis=0), axis=0)))


def known(data, order="auto", **options):
    d = DERIVATIVE / STEP
    controller = control.ss(control.tf([PROPORTIONAL + d, -d], [1.0, 0.0], STEP))
    return vodma(data, {"motor": controller}, order, **options)


METHODS = [n4sid, moesp, cva, vodma_direct, pbsid, known]


@pytest.mark.parametrize("method", METHODS)
def test_closed_loop_without_noise(method):
    # The thesis has 99.37 to 99.60 %.
    found = method(experiment(1), horizon=None)
    assert found.order == 8
    assert fit(found, experiment(2)) > 99.99


@pytest.mark.parametrize("method", METHODS[:-1])
def test_open_loop(method):
    # The thesis has 99.98 to 100 %.
    assert fit(method(experiment(1, closed=False), 8), experiment(2, closed=False)) > 99.99


@pytest.mark.parametrize("method", [n4sid, pbsid])
def test_a_clipped_command_that_is_measured_costs_nothing(method):
    # The thesis has 33 to 79 % where the controller's output stood for the command.
    data = experiment(1, limit=1.5)
    assert np.mean(np.abs(data.input) >= 1.5) > 0.1
    assert fit(method(data), experiment(2, limit=1.5)) > 99.99


@pytest.mark.slow
def test_with_noise_of_four_degrees_the_predictor_based_model_is_nearly_the_plant():
    # The thesis has 87.3 to 93.2 %, its true system 90.4 %.
    data, other = experiment(1, noise=4.0 / 3.0), experiment(2, noise=4.0 / 3.0)
    system = plant()
    found = pbsid(data)
    true = type(found)(**(vars(found) | {"a": system.A, "b": system.B, "c": system.C, "d": system.D}))
    ceiling = fit(true, other)
    assert found.order == 8
    assert fit(found, other) > ceiling - 1.0
    assert fit(known(data, 8), other) > ceiling - 10.0
    refined = prediction_error(data, found, focus="simulation")
    assert fit(refined, other) > ceiling - 0.05
