from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import butter, sosfilt

import control
from idloop.errors import InputError
from idloop.estimation.linear.propagate import respond
from idloop.estimation.subspace import cva, default_horizon, moesp, n4sid, pbsid, vodma, vodma_direct

from .conftest import STEP, distance, experiment, plant, response

FEEDBACK = 0.3


def known(data, order="auto", **options):
    return vodma(data, {"y1": control.ss([], [], [], FEEDBACK, STEP)}, order, **options)


OPEN = [n4sid, moesp, cva, vodma_direct, pbsid]
CLOSED = [known, pbsid]


@pytest.mark.parametrize("method", [*OPEN, known])
@pytest.mark.parametrize("feedback", [0.0, FEEDBACK])
def test_without_noise_every_method_finds_the_plant_and_its_order(method, feedback):
    true = plant()
    found = method(experiment(true, 800, feedback=feedback if method is not known else FEEDBACK))
    assert found.order == 3
    assert distance(found, true) < 1e-9
    assert found.loss < 1e-20


@pytest.mark.parametrize("method", OPEN)
def test_error_falls_with_the_root_of_the_samples(method):
    true = plant()

    def error(samples):
        return np.median([distance(method(experiment(true, samples, 0.5, seed), 3), true) for seed in range(8)])

    assert 2.5 < error(1000) / error(16000) < 6.5


@pytest.mark.parametrize("method", OPEN)
def test_kalman_gain_and_innovations_are_those_that_made_the_data(method):
    true = plant()
    found = method(experiment(true, 30_000, 0.5), 3)
    # Of the gain, C A^k K does not depend on the states' coordinates.
    for power in range(3):
        want = true.c @ np.linalg.matrix_power(true.a, power) @ true.gain
        got = found.c @ np.linalg.matrix_power(found.a, power) @ found.gain
        np.testing.assert_allclose(got, want, atol=0.03)
    np.testing.assert_allclose(found.covariance, 0.25 * np.eye(2), atol=0.01)


@pytest.mark.parametrize("method", CLOSED)
def test_methods_for_closed_loops_are_consistent_there(method):
    true = plant()
    errors = [distance(method(experiment(true, 30_000, 2.0, seed, FEEDBACK), 3), true) for seed in range(3)]
    assert np.mean(errors) < 0.12


@pytest.mark.parametrize("method", [n4sid, moesp, cva, vodma_direct])
def test_methods_for_open_loops_are_biased_in_closed_loop(method):
    true = plant()
    errors = [distance(method(experiment(true, 30_000, 2.0, seed, FEEDBACK), 3), true) for seed in range(3)]
    assert np.min(errors) > 0.2


@pytest.mark.parametrize("method", CLOSED)
def test_error_in_closed_loop_falls_with_the_root_of_the_samples(method):
    true = plant()

    def error(samples):
        return np.median(
            [distance(method(experiment(true, samples, 0.7, seed, FEEDBACK), 3), true) for seed in range(8)]
        )

    assert 2.3 < error(1000) / error(16000) < 7.0


def test_dynamic_controller_in_all_forms():
    true = plant()
    integral = control.ss([[0.9]], [[1.0]], [[0.1]], [[0.2]], STEP)
    a = np.block(
        [[true.a - true.b @ integral.D @ true.c[:1], -true.b @ integral.C], [integral.B @ true.c[:1], integral.A]]
    )
    rng = np.random.default_rng(0)
    r, e, x = rng.normal(size=6000), rng.normal(size=(6000, 2)), np.zeros(4)
    u, y = np.empty((6000, 1)), np.empty((6000, 2))
    for k in range(6000):
        y[k] = true.c @ x[:3] + e[k]
        u[k] = r[k] - integral.C @ x[3:] - integral.D @ y[k, :1]
        x = np.concatenate(
            [true.a @ x[:3] + true.b @ u[k] + true.gain @ e[k], integral.A @ x[3:] + integral.B @ y[k, :1]]
        )
    assert np.max(np.abs(np.linalg.eigvals(a))) < 1.0
    data = replace(experiment(true, 6000), input=u, output=y)
    by_name = vodma(data, {"y1": integral}, 3)
    whole = control.ss(integral.A, np.hstack([integral.B, [[0.0]]]), integral.C, [[0.2, 0.0]], STEP)
    np.testing.assert_allclose(vodma(data, whole, 3).a, by_name.a)
    np.testing.assert_allclose(vodma(data, {"y1": control.ss2tf(integral)}, 3).poles, by_name.poles, rtol=1e-6)
    assert distance(by_name, true) < 0.15
    assert distance(vodma_direct(data, 3), true) > 1.5 * distance(by_name, true)


@pytest.mark.parametrize("method", CLOSED)
def test_unstable_plant_under_feedback(method):
    true = plant(a=[[1.05, 0.1], [0.0, 0.7]], b=[[0.1], [1.0]], c=[[1.0, 0.0]], gain=[[0.4], [0.1]])
    data = experiment(true, 8000, 0.1, feedback=1.0)
    found = vodma(data, control.ss([], [], [], 1.0, STEP), 2) if method is known else pbsid(data, 2)
    np.testing.assert_allclose(np.sort(found.poles.real), [0.7, 1.05], atol=0.02)
    assert not found.stable
    assert "grows by a factor of 1.0" in found.notes[0]
    if method is pbsid:
        assert pbsid(data, 2, stable=True).stable


@pytest.mark.parametrize("method", OPEN)
def test_integrating_plant(method):
    true = plant(a=[[1.0, 0.1], [0.0, 0.8]], b=[[0.0], [0.1]], c=[[1.0, 0.0]], gain=[[0.5], [0.1]])
    found = method(experiment(true, 4000, 0.01), 2)
    np.testing.assert_allclose(np.sort(found.poles.real), [0.8, 1.0], atol=0.02)
    held = method(experiment(true, 4000, 0.01), 2, stable=True)
    assert held.stable


@pytest.mark.parametrize("method", OPEN)
def test_feedthrough_is_estimated_or_zero(method):
    true = plant(d=[[0.7], [0.0]])
    data = experiment(true, 3000, 0.05)
    found = method(data, 3, feedthrough=True)
    np.testing.assert_allclose(found.d, true.d, atol=0.02)
    assert found.free == method(data, 3).free + 2
    assert not np.any(method(data, 3).d)


@pytest.mark.parametrize("method", OPEN)
def test_experiments_are_joined_without_a_seam(method):
    true = plant()
    parts = [experiment(true, 700, 0.0, seed, start=(5.0, -5.0, 10.0 * seed)) for seed in range(3)]
    assert distance(method(parts, 3), true) < 1e-8


@pytest.mark.parametrize("method", OPEN)
@given(command=st.floats(-9, 9), measure=st.floats(-9, 9))
def test_units_do_not_matter(method, command, measure):
    true = plant()
    data = experiment(true, 400, 0.1)
    before = method(data, 3)
    other = replace(data, input=data.input * 10.0**command, output=data.output * np.array([10.0**measure, 1.0]))
    after = method(other, 3)
    factor = np.array([[10.0 ** (measure - command)], [10.0**-command]])
    frequency = np.array([0.1, 1.0])
    # The oblique projection weighs outputs of unit deviation alike, so that even N4SID does not see their units.
    np.testing.assert_allclose(after.response(frequency) / factor, before.response(frequency), rtol=1e-6, atol=1e-9)


def test_two_inputs():
    true = plant(b=[[0.3, 0.0], [0.2, 1.0], [1.0, 0.5]])
    data = experiment(true, 4000, 0.1)
    for method in OPEN:
        assert distance(method(data, 3), true) < 0.03


@pytest.mark.parametrize("method", [n4sid, cva, pbsid])
def test_order_is_found(method):
    true = plant()
    orders = [method(experiment(true, 3000, 0.3, seed)).order for seed in range(10)]
    assert orders.count(3) >= 9


def test_order_of_noise_alone_is_as_small_as_can_be():
    rng = np.random.default_rng(0)
    data = replace(experiment(plant(), 3000), output=rng.normal(size=(3000, 2)))
    assert n4sid(data).order == 1
    assert pbsid(data).order == 1


def test_the_horizon_grows_with_the_memory_of_the_noise():
    short = experiment(plant(), 5000, 1.0)
    # Hardly any process noise: the best predictor forgets slowly.
    long = experiment(plant(gain=np.full((3, 2), 0.01), a=np.diag([0.99, 0.95, 0.9])), 5000, 1.0)
    assert default_horizon(short) <= default_horizon(long)
    assert default_horizon(short, order=15) >= 17


def test_narrow_excitation_does_not_break_the_predictor():
    true = plant()
    data = experiment(true, 6000, 0.0)
    rng = np.random.default_rng(1)
    u = sosfilt(butter(5, 0.2, output="sos"), rng.normal(size=6000))[:, None]
    e = 0.2 * rng.normal(size=(6000, 2))
    y = respond(
        true.a, np.hstack([true.b, true.gain]), true.c, np.hstack([true.d, np.eye(2)]), np.zeros(3), np.hstack([u, e])
    )
    narrow = replace(data, input=u, output=y)
    found = pbsid(narrow, 3, past=30)
    inside = np.array([0.05, 0.2, 0.5])
    want = response(true, inside)
    assert np.linalg.norm(found.response(inside) - want) < 0.1 * np.linalg.norm(want)
    assert found.stable


def test_clipped_command_does_not_spoil_the_direct_methods():
    true = plant()
    rng = np.random.default_rng(0)
    x, u, y = np.zeros(3), np.empty((3000, 1)), np.empty((3000, 2))
    for k in range(3000):
        y[k] = true.c @ x
        u[k] = np.clip(rng.normal() - FEEDBACK * y[k, 0], -0.6, 0.6)
        x = true.a @ x + true.b @ u[k]
    data = replace(experiment(true, 3000), input=u, output=y)
    assert distance(pbsid(data), true) < 1e-8
    assert distance(n4sid(data), true) < 1e-8


def test_result_can_be_written_and_predicts_its_own_data():
    data = experiment(plant(), 2000, 0.1)
    found = n4sid(data)
    document = found.to_dict()
    assert document["singular_values"][2] > document["singular_values"][3]
    np.testing.assert_allclose(np.cov(found.innovations(data).T), found.covariance, rtol=0.01, atol=1e-4)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda d: n4sid(d.part(0, 25)), "too few"),
        (lambda d: n4sid(d, horizon=200), "too few for windows of 400"),
        (lambda d: n4sid(replace(d, input=0.0 * d.input)), "u1 never changes"),
        (lambda d: pbsid(replace(d, output=d.output * [1.0, 0.0])), "y2 never changes"),
        (lambda d: n4sid(d, 40, horizon=10), "order 40 with a horizon of 10 samples; give 1 to 18"),
        (lambda d: n4sid(d, "best"), 'neither "auto" nor'),
        (lambda d: n4sid(d, 2, horizon=1), "give at least 2"),
        (lambda d: pbsid(d, 2, past=5, horizon=9), "give 2 to 5"),
        (lambda d: pbsid(replace(d, input=np.sin(np.arange(1000.0))[:, None]), 2), "follows from its own past"),
        (
            lambda d: n4sid(replace(d, input=np.sin(np.arange(1000.0))[:, None]), 2),
            "u1 .* persistently exciting of order 2 only as a single sine is, and 4 is needed here; .* oe of order 1",
        ),
        (
            lambda d: n4sid(replace(d, input=np.sin(np.arange(1000.0))[:, None]), 2, horizon=9),
            "persistently exciting of order 2 only as a single sine is, and 4 is needed",
        ),
        (
            lambda d: pbsid(replace(d, input=np.sin(np.arange(1000.0))[:, None]), 2, past=10),
            "persistently exciting of order 2 only as a single sine is, and 11 is needed",
        ),
        (
            lambda d: pbsid(
                replace(d, input=d.input * [1.0, 2.0], input_names=("a", "b"), input_units=("V", "V"))
            ),
            "a, b move together",
        ),
        (lambda d: vodma(d, {"y7": control.ss([], [], [], 1.0, STEP)}), 'controller of "y7"'),
        (lambda d: vodma(d, control.ss([], [], [], 1.0, STEP)), "it must lead from 2 measured outputs to 1"),
        (lambda d: vodma(d, {"y1": control.ss([], [], [], 1.0, 0.2)}), "sample time 0.2"),
        (lambda d: vodma(d, {"y1": control.tf([1.0], [1.0, 1.0])}), "sample time 0"),
    ],
)  # fmt: skip
def test_bad_input_is_one_line(change, message):
    with pytest.raises(InputError, match=message) as caught:
        change(experiment(plant(), 1000, 0.1))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("method", OPEN)
def test_a_known_integrator_is_put_on_the_circle_and_the_other_poles_stay(method):
    true = plant(a=[[1.0, 0.1], [0.0, 0.8]], b=[[0.0], [0.1]], c=[[1.0, 0.0]], gain=[[0.5], [0.1]])
    data = experiment(true, 2000, 0.05)
    free, held = method(data, 2, integrates=False), method(data, 2, integrates=True)
    assert abs(np.max(held.poles.real) - 1.0) < 1e-8
    assert np.min(held.poles.real) == pytest.approx(np.min(free.poles.real), abs=1e-9)
    assert abs(np.max(free.poles.real) - 1.0) > 1e-6


@pytest.mark.parametrize("method", [n4sid, moesp, cva])
@pytest.mark.parametrize("slow", [1.0, 0.998])
def test_of_a_pole_that_no_window_shows_the_free_run_decides_whether_it_integrates(method, slow):
    true = plant(a=[[slow, 0.1], [0.0, 0.8]], b=[[0.0], [0.1]], c=[[1.0, 0.0]], gain=[[0.0], [0.0]])
    data = experiment(true, 8000, 0.2)
    found = method(data, 2, horizon=8)
    assert any("integrator" in note for note in found.notes) == (slow == 1.0)
    assert np.max(found.poles.real) == pytest.approx(slow, abs=1e-8 if slow == 1.0 else 1e-3)


def test_an_integrator_that_the_data_contradict_is_one_line(true):
    with pytest.raises(InputError, match="no integrator"):
        n4sid(experiment(true, 2000, 0.05), 3, integrates=True)
