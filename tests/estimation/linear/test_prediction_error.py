from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm
from scipy.signal import lfilter

import control
from idloop.errors import InputError
from idloop.estimation.black_box.sampled import SampledData
from idloop.estimation.linear import LinearModel, d2c, fit_structure, prediction_error, sensitivity
from idloop.estimation.linear.propagate import respond
from idloop.estimation.linear.sensitivity import Matrices, compressed_errors, error_moments

STEP = 0.1
A = np.array([[1.5, -0.7], [1.0, 0.0]])
B = np.array([[1.0], [0.0]])
C = np.array([[1.0, 0.5]])
K = np.array([[0.8], [0.3]])


def model(a=A, b=B, c=C, gain=K, **changes):
    p, m = len(c), b.shape[1]
    fields = {
        "method": "start", "a": a, "b": b, "c": c, "d": np.zeros((p, m)), "gain": gain, "covariance": np.eye(p),
        "sample_time": STEP, "input_names": ("u",), "input_units": ("V",),
        "output_names": tuple(f"y{i}" for i in range(p)), "output_units": ("rad",) * p, "samples": 0, "free": 0,
    }  # fmt: skip
    return LinearModel(**(fields | changes))


def made_by(source, samples=1500, noise=0.3, seed=0, start=None):
    rng = np.random.default_rng(seed)
    p = len(source.c)
    both = np.hstack([rng.normal(size=(samples, 1)), noise * rng.normal(size=(samples, p))])
    state = np.zeros(source.order) if start is None else np.array(start)
    y = respond(source.a, np.hstack([source.b, source.gain]), source.c, np.hstack([source.d, np.eye(p)]), state, both)
    return SampledData("made", both[:, :1].copy(), y, STEP, ("u",), ("V",), source.output_names, ("rad",) * p)


def off(source, size=0.05, seed=5):
    """A start model beside the true one, in other coordinates."""
    rng = np.random.default_rng(seed)
    turn = np.eye(source.order) + 0.3 * rng.normal(size=(source.order,) * 2)
    back = np.linalg.inv(turn)
    a = turn @ (source.a * (1 - size)) @ back
    return replace(
        source, a=a, b=turn @ source.b * (1 + size), c=source.c @ back, gain=turn @ source.gain * (1 - 4 * size)
    )


@given(seed=st.integers(0, 30), initial=st.booleans())
def test_gradient_and_curvature_are_those_of_the_sum_of_squares(seed, initial):
    rng = np.random.default_rng(seed)
    # An unstable predictor would lose the digits that are compared.
    closed, c, gain = rng.normal(size=(3, 3)), rng.normal(size=(2, 3)), 0.3 * rng.normal(size=(3, 2))
    closed *= 0.9 / np.max(np.abs(np.linalg.eigvals(closed)))
    base = Matrices(closed + gain @ c, rng.normal(size=(3, 2)), c, rng.normal(size=(2, 2)), gain)
    experiments = [(rng.normal(size=(n, 2)), rng.normal(size=(n, 2))) for n in (30, 50)]
    moves = base.like(rng.normal(size=(base.flat().size, 4)))
    whitener = np.array([[2.0, 0.0], [0.5, 1.0]])

    def cost(step):
        moved = base.like(base.flat() + moves.flat() @ step)
        residual, _ = compressed_errors(moved, None, experiments, whitener, initial)
        return 0.5 * residual @ residual

    residual, jacobian = compressed_errors(base, moves, experiments, whitener, initial)
    assert 0.5 * residual @ residual == pytest.approx(cost(np.zeros(4)), rel=1e-9)
    small = 1e-5 * np.eye(4)
    numeric = [(cost(step) - cost(-step)) / 2e-5 for step in small]
    np.testing.assert_allclose(jacobian.T @ residual, numeric, rtol=1e-5, atol=1e-5 * abs(cost(np.zeros(4))))


def test_blocks_of_a_long_record_make_no_difference(monkeypatch):
    data = made_by(model(), 3000)
    base = Matrices(A, B, C, np.zeros((1, 1)), K)
    moves = base.like(np.eye(base.flat().size))
    arguments = (base, moves, [(data.input, data.output)], np.eye(1))
    one = compressed_errors(*arguments)[1]
    monkeypatch.setattr(sensitivity, "_BLOCK_NUMBERS", 100)
    many = compressed_errors(*arguments)[1]
    np.testing.assert_allclose(many.T @ many, one.T @ one, rtol=1e-9)


def test_errors_of_the_true_model_are_the_noise():
    data = made_by(model(), 4000, start=(3.0, -2.0))
    moments = error_moments(Matrices(A, B, C, np.zeros((1, 1)), K), [(data.input, data.output)], initial=True)
    assert moments[0, 0] == pytest.approx(0.09, rel=0.05)


def test_all_matrices_are_found_from_a_start_beside_them():
    true = model()
    data = made_by(true, 6000)
    found = prediction_error(data, off(true))
    assert (found.method, found.start) == ("pem", "start")
    assert found.free == 2 * (1 + 2)
    np.testing.assert_allclose(np.sort_complex(found.poles), np.sort_complex(true.poles), atol=0.01)
    assert found.loss == pytest.approx(0.09, rel=0.05)
    assert found.loss <= np.var(true.innovations(data)) * (1 + 1e-6)
    for power in range(3):
        want = C @ np.linalg.matrix_power(A, power) @ K
        np.testing.assert_allclose(found.c @ np.linalg.matrix_power(found.a, power) @ found.gain, want, atol=0.05)


def test_refining_again_changes_nothing():
    data = made_by(model(), 2000)
    once = prediction_error(data, off(model()))
    twice = prediction_error(data, once)
    assert (twice.method, twice.start) == ("pem", "start")
    np.testing.assert_allclose(twice.poles, once.poles, atol=1e-4)
    assert twice.loss == pytest.approx(once.loss, rel=1e-7)


def test_the_minimum_does_not_depend_on_the_start_or_the_units():
    data = made_by(model(), 1500)
    first = prediction_error(data, off(model()))
    scaled = replace(data, input=1e6 * data.input, output=1e-5 * data.output)
    start = off(model(), seed=8)
    second = prediction_error(
        scaled, replace(start, a=start.a, b=start.b * 1e-3, c=start.c * 1e-8, gain=start.gain * 1e8)
    )
    np.testing.assert_allclose(np.sort_complex(second.poles), np.sort_complex(first.poles), atol=1e-3)
    np.testing.assert_allclose(second.covariance, 1e-10 * first.covariance, rtol=1e-5)


@pytest.mark.parametrize("kind", ["ss", "tf", "continuous"])
def test_the_search_starts_from_any_system_of_python_control(kind):
    data = made_by(model())
    held = control.ss(0.95 * A, B, C, 0.0, STEP)
    start = {"ss": held, "tf": control.tf(held), "continuous": d2c(held)}[kind]
    found, wanted = prediction_error(data, start), prediction_error(data, model())
    assert (found.method, found.start, found.input_names) == ("pem", "given", ("u",))
    assert found.loss == pytest.approx(wanted.loss, rel=1e-6)
    np.testing.assert_allclose(found.response([0.5, 2.0]), wanted.response([0.5, 2.0]), rtol=1e-3)


@pytest.mark.parametrize(
    ("start", "message"),
    [
        (np.eye(2), "start model of type ndarray"),
        (control.ss(A, np.eye(2), C, 0.0, STEP), "the start model has 2 and 1"),
        (control.ss(A, B, C, 0.0, 2 * STEP), "sample time"),
    ],
)
def test_another_start_is_one_line(start, message):
    with pytest.raises(InputError, match=message) as caught:
        prediction_error(made_by(model(), 100), start)
    assert "\n" not in str(caught.value)


def test_without_noise_the_search_ends_at_the_plant():
    true = model(gain=np.zeros((2, 1)))
    data = made_by(true, 500, noise=0.0)
    for focus in ("prediction", "simulation"):
        found = prediction_error(data, off(true), focus=focus)
        np.testing.assert_allclose(np.sort_complex(found.poles), np.sort_complex(true.poles), atol=1e-6)


def test_feedthrough_is_searched_on_request():
    true = model(d=np.array([[0.5]]))
    data = made_by(true, 4000)
    assert prediction_error(data, replace(off(true), d=np.zeros((1, 1)))).d[0, 0] == 0.0
    found = prediction_error(data, replace(off(true), d=np.zeros((1, 1))), feedthrough=True)
    assert found.d[0, 0] == pytest.approx(0.5, abs=0.03)


def test_two_outputs_of_correlated_noise_are_weighed_by_it():
    true = model(c=np.array([[1.0, 0.5], [0.3, 1.0]]), gain=np.array([[0.3, 0.1], [0.0, 0.2]]))
    data = made_by(true, 4000)
    mix = np.array([[1.0, 0.0], [0.95, 0.1]])
    mixed = replace(data, output=data.output @ mix.T)
    one = prediction_error(data, off(true))
    two = prediction_error(mixed, replace(off(true), c=mix @ off(true).c, gain=off(true).gain @ np.linalg.inv(mix)))
    # The determinant's minimum is the same whatever combinations of the outputs are taken.
    np.testing.assert_allclose(np.sort_complex(two.poles), np.sort_complex(one.poles), atol=2e-4)


def test_experiments_with_their_own_first_states():
    true = model()
    data = [made_by(true, 400, seed=seed, start=(50.0 * seed, -30.0)) for seed in range(4)]
    found = prediction_error(data, off(true))
    np.testing.assert_allclose(np.sort_complex(found.poles), np.sort_complex(true.poles), atol=0.03)
    assert found.samples == 1600
    assert prediction_error(data, off(true), initial=False).loss > 2.0 * found.loss


def test_free_entries_have_standard_errors_that_hold():
    true = model()
    free = {"a": [[True, True], [False, False]], "b": [[True], [False]], "gain": True}
    want = np.array([1.5, -0.7, 1.0, 0.8, 0.3])
    start = model(a=np.array([[1.4, -0.6], [1.0, 0.0]]), b=0.8 * B, gain=0.5 * K)
    scores = []
    for seed in range(60):
        found = prediction_error(made_by(true, 600, seed=seed), start, free=free)
        assert [one.name for one in found.coefficients] == ["a[0,0]", "a[0,1]", "b[0,0]", "gain[0,0]", "gain[1,0]"]
        scores.append([(one.value - w) / one.stderr for one, w in zip(found.coefficients, want, strict=True)])
        np.testing.assert_array_equal(found.a[1], [1.0, 0.0])
    spread = np.std(scores, axis=0)
    assert np.all((spread > 0.75) & (spread < 1.3))
    assert np.all(np.abs(np.mean(scores, axis=0)) < 0.6)


def second_order(frequency, damping, scale):
    return (
        [[0.0, 1.0], [-(frequency**2), -2.0 * damping * frequency]],
        [[0.0], [scale]],
        [[1.0, 0.0]],
        [[0.0]],
    )


def oscillator(samples=1500, noise=0.05, seed=0, colour=0.9):
    a, b, c, d = (np.array(part) for part in second_order(2.0, 0.2, 3.0))
    joint = np.zeros((3, 3))
    joint[:2] = np.hstack([a, b])
    sampled = expm(joint * STEP)[:2]
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.normal(size=samples // 10), 10)[:, None]
    y = respond(sampled[:, :2].copy(), sampled[:, 2:].copy(), c, d, np.array([0.5, 0.0]), u)
    e = lfilter([np.sqrt(1 - colour**2)], [1.0, -colour], noise * rng.normal(size=(samples, 1)), axis=0)
    return SampledData("made", u, y + e, STEP, ("u",), ("V",), ("y",), ("rad",))


@pytest.mark.slow
def test_continuous_structure_is_recovered_and_its_standard_errors_hold_under_coloured_errors():
    scores = []
    for seed in range(60):
        found = fit_structure(
            oscillator(seed=seed), second_order, {"frequency": 1.5, "damping": 0.4, "scale": 2.0}, continuous=True
        )
        scores.append([(c.value - w) / c.stderr for c, w in zip(found.coefficients, (2.0, 0.2, 3.0), strict=True)])
    spread = np.std(scores, axis=0)
    assert np.all((spread > 0.7) & (spread < 1.4))
    assert np.all(np.abs(np.mean(scores, axis=0)) < 0.6)
    assert found.method == "structure"
    np.testing.assert_allclose(np.log(found.poles.astype(complex)).real / STEP, -0.4, atol=0.1)


def test_the_structure_of_the_true_noise_is_more_certain_than_the_free_run():
    def with_noise(frequency, damping, scale, gain):
        a, b, c, d = second_order(frequency, damping, scale)
        return a, b, c, d, [[gain], [0.0]]

    start = {"frequency": 1.5, "damping": 0.4, "scale": 2.0}
    data = made_by(model(), 2000)

    def discrete(a, b, k):
        return [[a, -0.7], [1.0, 0.0]], [[b], [0.0]], C, [[0.0]], [[k], [0.3]]

    begin = {"a": 1.4, "b": 0.8, "k": 0.1}
    predicted = fit_structure(data, discrete, begin)
    simulated = fit_structure(data, discrete, begin, focus="simulation", max_iterations=30)
    assert predicted.coefficients[0].stderr < simulated.coefficients[0].stderr
    assert simulated.coefficients[2].stderr != simulated.coefficients[2].stderr
    assert any("not shown by the data: k" in note for note in simulated.notes)
    held = fit_structure(oscillator(), with_noise, start | {"gain": 0.1}, continuous=True)
    assert held.coefficients[0].value == pytest.approx(2.0, abs=0.1)


def test_free_run_is_not_disturbed_by_coloured_noise_in_open_loop():
    data = oscillator(20_000, noise=0.3)
    a, b, c, d = (np.array(part) for part in second_order(2.0, 0.2, 3.0))
    sampled = control.ss(a, b, c, d).sample(STEP)
    start = model(a=0.97 * sampled.A, b=1.1 * sampled.B, c=c, gain=np.zeros((2, 1)), output_names=("y",))
    found = prediction_error(data, start, focus="simulation")
    assert not np.any(found.gain)
    np.testing.assert_allclose(np.sort_complex(found.poles), np.sort_complex(sampled.poles()), atol=0.003)


def test_a_free_run_from_a_stable_start_does_not_learn_to_diverge():
    data = made_by(model(gain=np.zeros((2, 1))), 400, noise=0.05)
    # What grows by itself is no part of the plant: a state that no command moves would follow it.
    grown = replace(data, output=data.output + 1e-3 * 1.02 ** np.arange(400)[:, None])
    a = np.zeros((3, 3))
    a[:2, :2], a[2, 2] = 0.97 * A, 0.98
    start = model(a=a, b=np.vstack([B, [[0.1]]]), c=np.hstack([C, [[0.1]]]), gain=np.zeros((3, 1)))
    found = prediction_error(grown, start, focus="simulation")
    assert np.max(np.abs(found.poles)) <= 1.0 + 1.0 / 400
    unstable = prediction_error(grown, replace(start, a=np.diag([1.0, 1.0, 1.02 / 0.98]) @ a), focus="simulation")
    assert np.max(np.abs(unstable.poles)) == pytest.approx(1.02, abs=1e-3)  # whoever starts there may stay there


def test_prefilter_chooses_what_an_undersized_model_fits():
    slow, fast = model(a=np.array([[0.98]]), b=np.array([[0.02]]), c=np.eye(1), gain=np.zeros((1, 1))), 0.3
    data = made_by(slow, 6000, noise=0.0)
    quick = lfilter([1.0], [1.0, fast], data.input, axis=0)
    both = replace(data, output=data.output + quick)
    low = control.tf(*(np.array(part) for part in ([0.02, 0.0], [1.0, -0.98])), STEP)
    start = model(a=np.array([[0.9]]), b=np.array([[0.1]]), c=np.eye(1), gain=np.zeros((1, 1)), d=np.ones((1, 1)))
    plain = prediction_error(both, start, focus="simulation")
    weighed = prediction_error(both, start, focus="simulation", prefilter=low)
    at = np.array([0.005])
    want = slow.response(at) + 1.0 / (1.0 + fast * np.exp(-2j * np.pi * at[0] * STEP))
    assert abs(weighed.response(at) - want)[0, 0, 0] < 0.3 * abs(plain.response(at) - want)[0, 0, 0]
    assert any("filtered" in note for note in weighed.notes)


def test_an_unstable_plant_is_refined_by_its_stable_predictor():
    true = model(
        a=np.array([[1.1, 0.2], [0.0, 0.7]]),
        b=np.array([[0.1], [1.0]]),
        c=np.array([[1.0, 0.0]]),
        gain=np.array([[0.6], [0.2]]),
    )
    rng = np.random.default_rng(0)
    x, u, y = np.zeros(2), np.empty((4000, 1)), np.empty((4000, 1))
    for k in range(4000):
        e = 0.05 * rng.normal(size=1)
        y[k] = true.c @ x + e
        u[k] = rng.normal() - 0.6 * y[k]
        x = true.a @ x + true.b @ u[k] + true.gain @ e
    data = SampledData("made", u, y, STEP, ("u",), ("V",), ("y0",), ("rad",))
    found = prediction_error(data, off(true, 0.02))
    np.testing.assert_allclose(np.sort(found.poles.real), [0.7, 1.1], atol=0.01)
    without = prediction_error(data, replace(off(true, 0.02), gain=np.zeros((2, 1))))
    np.testing.assert_allclose(without.covariance, found.covariance, rtol=1e-3)
    with pytest.raises(InputError, match="predictor A - K C is unstable"):
        prediction_error(data, replace(true, gain=np.zeros((2, 1))), free={"b": True})
    with pytest.raises(InputError, match='its free run overflows on the data; refine it with focus "prediction"'):
        prediction_error(data, off(true, 0.02), focus="simulation")


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda d: prediction_error(d, model(), free={"e": True}), 'free entries of "e"'),
        (lambda d: prediction_error(d, model(), free={"a": [True]}), "have shape"),
        (lambda d: prediction_error(d, model(), free={"a": False}), "no entry is free"),
        (lambda d: prediction_error(d, model(), free={"gain": True}, focus="simulation"), "the free run has none"),
        (lambda d: prediction_error(replace(d, sample_time=0.2), model()), "sample time"),
        (lambda d: fit_structure(d, second_order, {}), "at least one"),
        (lambda d: fit_structure(d, lambda x: (1, 2), {"x": 1.0}), "returns 2 matrices"),
        (lambda d: fit_structure(d, lambda x: (x, [[1, 2]], 1, 0), {"x": 0.5}), "B has shape"),
    ],
)  # fmt: skip
def test_bad_input_is_one_line(call, message):
    with pytest.raises(InputError, match=message) as caught:
        call(made_by(model(), 100))
    assert "\n" not in str(caught.value)
