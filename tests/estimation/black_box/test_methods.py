"""The registry: every method finds a known plant, chooses orders and delays, and fails in one line."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import cont2discrete, lfilter

from idloop.control import build_controller
from idloop.errors import InputError
from idloop.estimation.black_box.identification import identify, information
from idloop.estimation.black_box.method import Choices
from idloop.estimation.black_box.methods import METHODS, find_method
from idloop.estimation.black_box.sampled import SampledData

STEP = 0.01
B, A = [0.0, 0.1, 0.05], [1.0, -1.5, 0.7]
HZ = np.array([1.0, 5.0, 15.0])
MODELS = [name for name, method in METHODS.items() if method.kind in {"linear", "recursive"} and name != "vodma"]


def truth(frequency=HZ):
    z = np.exp(-2j * np.pi * frequency * STEP)
    return np.polyval(B[::-1], z) / np.polyval(A[::-1], z)


def open_loop(samples=4000, noise=0.02, seed=0, delay=1, **names):
    random = np.random.default_rng(seed)
    u = random.normal(size=samples)
    shifted = np.concatenate([np.zeros(delay - 1), u])[:samples]
    y = lfilter(B, A, shifted) + noise * random.normal(size=samples)
    return SampledData("record", u[:, None], y[:, None], STEP, **names)


@pytest.mark.parametrize("name", MODELS)
def test_every_linear_method_finds_the_plant(name):
    found = identify(open_loop(noise=0.002), name, Choices(order=2))
    error = np.abs(found.linear.response(HZ)[:, 0, 0] - truth()) / np.abs(truth())
    # A recursion is still on its way after so few samples.
    assert np.max(error) < (0.1 if found.method.kind == "recursive" else 0.02)
    assert found.linear.poles.size >= 2
    assert found.linear.method == name
    assert information(found, [open_loop()]).bic == found.linear.bic
    assert (found.delay is None) == ("delay" not in found.method.needs)


def two_resonances(samples=6000):
    """Two lightly damped modes side by side, at 3 and at 20 Hz."""
    random = np.random.default_rng(5)
    u, y = random.normal(size=samples), np.zeros(samples)
    for hz in (3.0, 20.0):
        pole = np.exp(2.0 * np.pi * hz * STEP * (-0.03 + 1.0j))
        y += lfilter([0.0, abs(1.0 - pole) ** 2], np.real(np.poly([pole, pole.conj()])), u)
    return SampledData("record", u[:, None], (y + 0.02 * random.normal(size=samples))[:, None], STEP)


@pytest.mark.slow
@pytest.mark.parametrize("name", ("oe", "bj", "pem"))
def test_a_model_too_small_for_two_resonances_has_that_of_its_band(name):
    for low, high, hz in ((0.0, 8.0, 3.0), (10.0, 35.0, 20.0), (12.0, np.inf, 20.0)):
        focus = "simulation" if name == "pem" else "prediction"
        found = identify(two_resonances(), name, Choices(order=2, band=(low, high), focus=focus))
        own = np.abs(np.angle(found.linear.poles)) / (2.0 * np.pi * STEP)
        assert np.min(np.abs(own - hz)) < 0.1 * hz, (low, high, own)


def two_mass(samples=6000, seed=1, reference=None, noise=(2e-3, 0.1)):
    """Two bodies on a spring that turn on, by position and velocity of the driven one, every 5 ms."""
    step, inertias, random = 0.005, (2e-3, 1e-3), np.random.default_rng(seed)
    spring, between = 3.79, 1e-3
    a = np.array(
        [
            [0.0, 1.0, 0.0, 0.0],
            [-spring / inertias[0], -(between + 0.01) / inertias[0], spring / inertias[0], between / inertias[0]],
            [0.0, 0.0, 0.0, 1.0],
            [spring / inertias[1], between / inertias[1], -spring / inertias[1], -(between + 0.005) / inertias[1]],
        ]
    )
    b, c = np.array([[0.0], [1.0 / inertias[0]], [0.0], [0.0]]), np.eye(4)[:2]
    a, b, c, _, _ = cont2discrete((a, b, c, np.zeros((2, 1))), step)
    state, u = np.zeros(4), 0.15 * np.repeat(random.choice([-1.0, 1.0], samples // 2), 2)
    y, followed = np.zeros((samples, 2)), 0.5 * np.repeat(random.choice([-1.0, 1.0], samples // 10), 10)
    for k in range(samples):
        y[k] = c @ state + np.array(noise) * random.normal(size=2)
        if reference is not None:
            u[k] = reference * (followed[k] - y[k, 0])
        state = a @ state + b[:, 0] * u[k]
    return SampledData(
        "axis", u[:, None], y, step, output_names=("position", "velocity"), output_units=("rad", "rad/s"),
        reference=None if reference is None else followed,
    )  # fmt: skip


def test_prediction_errors_are_least_also_where_all_noise_is_the_sensors():
    # The start has a large Kalman gain and the truth has none; the quiet position tells what the integrator began with.
    found = identify(two_mass(), "pem", Choices(order=4))
    assert not found.linear.notes
    assert found.linear.loss == pytest.approx((2e-3 * 0.1) ** 2, rel=0.05)


def test_instruments_choose_the_order_by_the_free_run():
    found = identify(two_mass(), "iv4")
    assert min(t.bic for t in found.trials) == next(t.bic for t in found.trials if t.order == found.order)
    free = two_mass(seed=2)
    assert np.std((found.linear.simulate(free) - free.output)[:, 1]) < 1.1 * 0.1
    assert information(found, [free]).bic == found.linear.bic


@pytest.mark.parametrize(
    ("band", "words"),
    (((5.0, 2.0), "lower edge first"), ((0.0, 60.0), "half the sample rate, 50 Hz"), ((0.0, np.inf), "give an edge")),
)
def test_a_band_that_weighs_nothing_is_refused(band, words):
    with pytest.raises(InputError, match="--focus simulation"):
        identify(open_loop(500), "pem", Choices(order=2, band=(1.0, 5.0)))
    with pytest.raises(InputError, match=words):
        identify(open_loop(500), "arx", Choices(order=2, band=band))


@pytest.mark.parametrize("name", ("etfe", "spa", "welch"))
def test_responses_come_near_the_plant(name):
    found = identify(open_loop(20000), name, Choices(window=200))
    response = found.model
    # One tenth of a band of 3 Hz, where the plant is flat beside its resonance.
    at = [int(np.argmin(np.abs(response.frequency - f))) for f in HZ]
    assert np.max(np.abs(response.response[at, 0, 0] - truth()) / np.abs(truth())) < 0.25
    assert not found.predicts
    with pytest.raises(InputError, match="compare models"):
        information(found, [open_loop()])


@pytest.mark.parametrize("name", ("oe", "welch", "cra", "narx-wavelet"))
def test_a_result_draws_itself(name):
    import matplotlib.pyplot as plt

    axes = identify(open_loop(1000), name, Choices(order=2)).plot()
    assert axes is not None
    plt.close("all")


def test_a_bode_diagram_of_two_outputs_names_the_unit_of_each():
    import matplotlib.pyplot as plt

    for name in ("n4sid", "welch"):
        magnitude = identify(two_mass(1500), name, Choices(order=4)).plot()[0]
        assert [text.get_text() for text in magnitude.get_legend().get_texts()] == [
            "input → position [rad]", "input → velocity [rad/s]",
        ]  # fmt: skip
        assert magnitude.get_ylabel() == "magnitude"
        plt.close("all")


def test_correlation_finds_the_weights():
    weights = lfilter(B, A, np.eye(1, 21)[0])
    model = identify(open_loop(20000), "cra", Choices(window=20)).model
    assert np.all(np.abs(model.response[model.lag >= 0, 0] - weights) < 4 * model.stderr[model.lag >= 0, 0])


@pytest.mark.parametrize("name", ("narx-wavelet", "narx-neural"))
def test_networks_are_repeatable_and_judged_like_models(name):
    data = open_loop(800)
    one, again = (identify(data, name, Choices(order=2, units=4, seed=3)) for _ in range(2))
    np.testing.assert_array_equal(one.model.simulate(data), again.model.simulate(data))
    known = information(one, [data])
    assert known.loss < 0.01 * np.var(data.output)
    assert known.aic < known.bic


@pytest.mark.slow
def test_the_order_with_the_least_bic_is_chosen():
    found = identify(open_loop(noise=0.05), "oe", Choices(order=(1, 2, 3, 4)))
    assert found.order == 2
    assert [trial.order for trial in found.trials] == [1, 2, 3, 4]
    assert min(found.trials, key=lambda trial: trial.bic).order == 2
    assert identify(open_loop(noise=0.05), "oe").order == 2


def test_the_delay_is_found_and_a_range_agrees():
    data = open_loop(delay=4)
    assert identify(data, "arx", Choices(order=2, delay="auto")).delay == 4
    assert identify(data, "oe", Choices(order=2, delay=(1, 2, 3, 4, 5))).delay == 4


def test_degrees_of_single_polynomials_are_heeded():
    found = identify(open_loop(), "rpem", Choices(order=3, structure={"na": 0, "nb": 2, "nc": 0, "nf": 2}))
    names = [c.name for c in found.linear.coefficients]
    assert names == ["b1[input]", "b2[input]", "f1[input]", "f2[input]"]
    everything = {"na": 2, "nb": 2}
    # With every degree given there is nothing left to try.
    assert identify(open_loop(), "arx", Choices(structure=everything)).trials == ()


def closed_loop(samples, noise, seed):
    """Integrating plant 0.1 q^-1 / (1 - 1.8 q^-1 + 0.8 q^-2) under a proportional controller, compiled as ours are."""
    spec = {"type": "p", "output": "motor.position", "kp": 1.0, "sample_time": STEP}
    controller = build_controller(spec)
    random = np.random.default_rng(seed)
    reference = np.repeat(random.choice([-1.0, 1.0], samples // 5), 5)
    e = lfilter([1.0], [1.0, -0.9], noise * random.normal(size=samples))
    u, y, x = np.zeros(samples), np.zeros(samples), np.zeros(samples)
    for k in range(samples):
        x[k] = 1.8 * x[k - 1] - 0.8 * x[k - 2] + 0.1 * u[k - 1] if k > 1 else 0.0
        y[k] = x[k] + e[k]
        u[k] = controller.step(reference[k], 0.0, [y[k]])
    data = SampledData(
        "loop", u[:, None], y[:, None], STEP, ("motor.effort",), ("V",), ("motor.position",), ("rad",),
        reference=reference,
    )  # fmt: skip
    return data, spec


def test_a_controller_of_another_period_is_noted():
    data, spec = closed_loop(1000, 0.1, 0)
    choices = Choices(order=2, controller=spec)
    assert not any("approximated" in note for note in identify(data, "vodma", choices).model.notes)
    quick = Choices(order=2, controller={**spec, "sample_time": STEP / 10})
    assert any("approximated" in note for note in identify(data, "vodma", quick).model.notes)


def test_under_feedback_methods_that_allow_it_beat_those_that_do_not():
    data, spec = closed_loop(8000, 0.3, 2)
    z = np.exp(-2j * np.pi * HZ * STEP)
    plant = 0.1 * z / (1 - 1.8 * z + 0.8 * z**2)

    def error(name, **choices):
        # The noise has a state of its own, which the one-step predictors of pbsid need.
        found = identify(data, name, Choices(order=3 if name == "pbsid" else 2, **choices))
        return np.max(np.abs(found.linear.response(HZ)[:, 0, 0] - plant) / np.abs(plant))

    assert error("vodma", controller=spec) < 0.25
    assert error("pbsid") < 0.25
    assert error("iv4", closed_loop=True) < 0.25
    assert error("vodma-direct") > 0.5
    assert error("iv4") > 0.5
    response = identify(data, "indirect", Choices(window=512)).model
    near = int(np.argmin(np.abs(response.frequency - 1.0)))
    assert abs(response.response[near, 0, 0] / plant[0] - 1) < 0.2


@pytest.mark.parametrize(
    ("method", "choices", "words"),
    (
        ("n5sid", {}, "did you mean 'n4sid'"),
        ("vodma", {}, "--controller"),
        ("bla", {}, "--period"),
        ("bla-fast", {"period": 0.1234}, "choose a sample time"),
        ("indirect", {}, "no reference"),
        ("n4sid", {"order": 60, "horizon": 10}, "longer horizon"),
        ("oe", {"order": (900, 901)}, "record"),
        ("oe", {"order": 2, "delay": "auto"}, "no clear effect"),
        ("oe", {"structure": {"na": 2}}, "na; its polynomials are nb, nf"),
        ("n4sid", {"structure": {"na": 2}}, "no polynomials"),
        ("arx", {"structure": {"nb": 0}}, "no effect in the model"),
    ),
)
def test_what_cannot_be_done_is_one_line(method, choices, words):
    data = open_loop(400, delay=30) if choices.get("delay") == "auto" else open_loop(400)
    with pytest.raises(InputError, match=words) as caught:
        identify(data, method, Choices(**choices))
    assert "\n" not in str(caught.value)


def test_every_method_says_what_it_is():
    for name, method in METHODS.items():
        assert find_method(name) is method
        assert method.summary.endswith(".")
        assert method.loop
        assert method.source
        unknown = set(method.needs) - set(Choices.__dataclass_fields__)
        assert not unknown


def test_numbers_that_overflow_on_the_way_to_a_model_are_one_line(monkeypatch):
    def overflow(*_):
        np.linalg.svd([[np.nan]])

    monkeypatch.setitem(METHODS, "oe", replace(METHODS["oe"], run=overflow))
    with pytest.raises(InputError, match="record: oe of order 150 overflows on the way to a model; lower the order"):
        identify(open_loop(), "oe", Choices(order=150))
