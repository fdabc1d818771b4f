"""Badly scaled, near-degenerate or poor data: a correct result, a note, or one clear error from every method."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from idloop.errors import IdloopError, InputError
from idloop.estimation.black_box.identification import identify
from idloop.estimation.black_box.method import Choices
from idloop.estimation.black_box.methods import METHODS
from idloop.estimation.black_box.sampled import SampledData

STEP, COUNT = 0.01, 1500
B, A = [0.0, 0.1, 0.05], [1.0, -1.5, 0.7]
LINEAR = [name for name, method in METHODS.items() if method.kind == "linear" and name != "vodma"]
RECURSIVE = [name for name, method in METHODS.items() if method.kind == "recursive"]
NETWORKS = [name for name, method in METHODS.items() if method.kind == "network"]
RESPONSES = [name for name, method in METHODS.items() if method.kind == "response"]


def record(u, y) -> SampledData:
    u, y = (np.asarray(one, dtype=float).reshape(len(one), -1) for one in (u, y))
    names = tuple(f"u{i}" for i in range(u.shape[1]))
    return SampledData("record", u, y, STEP, names, ("-",) * len(names), ("y",), ("-",))


def made(noise=0.02, b=B, a=A):
    """Command, undisturbed output, measured output."""
    random = np.random.default_rng(0)
    u = np.sign(random.standard_normal(COUNT))
    y = lfilter(b, a, u)
    return u, y, y + noise * np.std(y) * random.standard_normal(COUNT)


def fit(found, data, clean) -> float:
    """FIT of the free run to the undisturbed output [%]."""
    run = found.model.simulate(data)[:, 0]
    return 100.0 * (1.0 - np.linalg.norm(run - clean) / np.linalg.norm(clean - clean.mean()))


@pytest.mark.parametrize("name", [*LINEAR, *RECURSIVE, *NETWORKS])
@pytest.mark.parametrize("sizes", [(1e-8, 1e8), (1e9, 1e-9)])
def test_units_sixteen_decades_apart_change_nothing(name, sizes):
    u, clean, y = made()
    data = record(sizes[0] * u, sizes[1] * y)
    assert fit(identify(data, name, Choices(order=2)), data, sizes[1] * clean) > 93.0


@pytest.mark.parametrize("name", ["etfe", "spa", "welch", "cra"])
@pytest.mark.parametrize("sizes", [(1e-8, 1e8), (1e9, 1e-9)])
def test_units_scale_a_response_and_nothing_else(name, sizes):
    u, _, y = made()
    plain, scaled = (identify(record(a * u, b * y), name, Choices()).model for a, b in ((1.0, 1.0), sizes))
    expected = plain.response * sizes[1] / sizes[0]
    assert np.max(np.abs(scaled.response - expected)) < 1e-9 * np.max(np.abs(expected))


@pytest.mark.parametrize("name", [*LINEAR, *RECURSIVE, *NETWORKS])
def test_a_pole_that_a_zero_nearly_cancels_does_no_harm(name):
    u, clean, y = made(b=np.convolve(B, [1.0, -0.951]), a=np.convolve(A, [1.0, -0.95]))
    data = record(u, y)
    assert fit(identify(data, name, Choices(order=2)), data, clean) > 93.0


@pytest.mark.parametrize("name", LINEAR)
def test_an_integrating_plant_comes_out_or_the_model_says_that_it_runs_away(name):
    u, _, y = made(b=[0.0, 0.004, 0.0035], a=np.convolve([1.0, -1.0], [1.0, -0.8]))
    data = record(u, y)
    for focus in ("prediction", "simulation"):
        try:
            found = identify(data, name, Choices(order=2, focus=focus))
        except InputError:
            # Not every method has both.
            continue
        largest = float(np.max(np.abs(found.linear.poles)))
        assert abs(largest - 1.0) < 1e-3 or any(note.startswith("unstable") for note in found.model.notes)


@pytest.mark.parametrize("name", ["oe", "pem", "armax", "arx"])
@pytest.mark.parametrize("count", [60, 200])
def test_the_free_run_of_a_short_record_of_an_integrator_puts_its_pole_on_the_circle(name, count):
    u, _, y = made(noise=0.05, b=[0.0, 0.01], a=[1.0, -1.0])
    found = identify(record(u[:count], y[:count]), name, Choices(order=1, focus="simulation"))
    assert abs(float(np.max(np.abs(found.linear.poles))) - 1.0) < 1.0 / count


@pytest.mark.parametrize("name", ["roe", "rbj"])
def test_a_recursion_that_cannot_follow_an_integrator_says_so(name):
    u, _, y = made(b=[0.0, 0.01], a=[1.0, -1.0])
    notes = identify(record(u, y), name, Choices(order=2)).model.notes
    assert any("steps were shortened" in note for note in notes)


@pytest.mark.parametrize("name", ["arx", "oe", "n4sid", "rarx"])
def test_an_output_far_from_zero_is_noted(name):
    u, _, y = made()
    far = identify(record(u, y + 1e5), name, Choices(order=2))
    assert any("times its range" in note for note in far.model.notes)
    assert not any("whole motion" in note for note in identify(record(u, y), name, Choices(order=2)).model.notes)


LOOP = 2.0


def looped(pole=1.1, sizes=(1.0, 1.0)) -> SampledData:
    """A plant of one pole under a proportional controller of gain `LOOP`."""
    random = np.random.default_rng(1)
    reference = np.repeat(random.choice([-1.0, 1.0], COUNT // 5), 5)
    u, y = np.zeros(COUNT), np.zeros(COUNT)
    for k in range(COUNT):
        x = pole * y[k - 1] + 0.2 * u[k - 1] if k else 0.0
        y[k] = x + 0.01 * random.standard_normal()
        u[k] = LOOP * (reference[k] - y[k])
    return replace(record(sizes[0] * u, sizes[1] * y), output_names=("motor.position",))


def law(gain=LOOP):
    return {"type": "p", "output": "motor.position", "kp": gain, "sample_time": STEP}


UNSTABLE = [name for name in LINEAR if METHODS[name].loop.startswith("any")]


@pytest.mark.parametrize("name", [*UNSTABLE, "vodma", "rarx", "rarmax", "rpem", "rplr"])
def test_an_unstable_plant_in_its_loop_is_found_and_named(name):
    found = identify(looped(), name, Choices(order=1, controller=law()))
    if name == "bj":
        # Its predictor runs through F, which must not be unstable.
        assert any("unstable plant needs armax" in note for note in found.model.notes)
        return
    assert float(np.max(np.abs(found.linear.poles))) == pytest.approx(1.1, abs=0.02)
    assert any(note.startswith("unstable") for note in found.model.notes)


@pytest.mark.parametrize("name", ["ekf", "roe", "rbj"])
def test_a_recursion_that_cannot_follow_an_unstable_plant_says_so(name):
    notes = identify(looped(), name, Choices(order=1)).model.notes
    assert any("steps were shortened" in note for note in notes)


@pytest.mark.parametrize("sizes", [(1.0, 1.0), (1e-8, 1e8), (1e9, 1e-9)])
def test_a_known_controller_is_in_the_units_of_the_data(sizes):
    found = identify(looped(0.9, sizes), "vodma", Choices(order=1, controller=law(LOOP * sizes[0] / sizes[1])))
    assert found.linear.poles.real == pytest.approx([0.9], abs=0.02)


@pytest.mark.parametrize("name", ["rarx", "kalman", "ekf", "rarmax", "rpem", "rplr"])
def test_a_recursion_follows_an_integrator(name):
    u, _, y = made(noise=0.05, b=[0.0, 0.01], a=[1.0, -1.0])
    assert float(np.max(np.abs(identify(record(u, y), name, Choices(order=1)).linear.poles))) == pytest.approx(
        1.0, abs=2e-3
    )


POOR = {
    "zero input": lambda u, y: record(np.zeros(COUNT), y),
    "zero output": lambda u, y: record(u, np.zeros(COUNT)),
    "constant output": lambda u, y: record(u, np.full(COUNT, 3.0)),
    "dead second input": lambda u, y: record(np.column_stack([u, np.zeros(COUNT)]), y),
    "same input twice": lambda u, y: record(np.column_stack([u, 2.0 * u]), y),
    "one sine": lambda u, y: record(np.sin(0.1 * np.arange(COUNT)), y),
    "few samples": lambda u, y: record(u[:25], y[:25]),
}


@pytest.mark.parametrize("poor", POOR)
@pytest.mark.parametrize("name", [*LINEAR, *RECURSIVE, *NETWORKS, *RESPONSES])
def test_poor_data_give_numbers_or_one_line(name, poor):
    u, _, y = made()
    data = POOR[poor](u, y)
    message = ""
    try:
        model = identify(data, name, Choices(order="auto" if name in RESPONSES else 2)).model
    except IdloopError as error:
        message = str(error)
    assert "\n" not in message
    if message:
        return
    assert poor not in {"zero input", "zero output", "constant output"} or name in RESPONSES
    numbers = model.response if name in RESPONSES else model.simulate(data) if name in NETWORKS else model.a
    assert np.all(np.isfinite(numbers))


@pytest.mark.parametrize("size", [1e-200, 1e150])
def test_sizes_whose_squares_no_number_holds_are_one_line(size):
    u, _, y = made()
    with pytest.raises(InputError, match="another unit"):
        record(size * u, y)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["arx", "pbsid", "rarmax", "welch"])
def test_a_million_samples_are_no_more_than_a_long_record(name):
    random = np.random.default_rng(3)
    u = np.sign(random.standard_normal(1_000_000))
    data = record(u, lfilter(B, A, u) + lfilter([1.0], A, 0.02 * random.standard_normal(u.size)))
    found = identify(data, name, Choices(window=1024) if name == "welch" else Choices(order=2))
    frequency = np.array([1.0, 5.0, 15.0]) if name != "welch" else found.model.frequency
    z = np.exp(-2j * np.pi * frequency * STEP)
    true = np.polyval(B[::-1], z) / np.polyval(A[::-1], z)
    response = (found.model.response if name == "welch" else found.linear.response(frequency))[:, 0, 0]
    assert np.median(np.abs(response / true - 1.0)) < (0.02 if name == "welch" else 3e-3)
