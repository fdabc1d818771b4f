"""Force balance in weak form."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from idloop.estimation.dataset import prepare
from idloop.estimation.force_balance.weak_form import NARROWEST, WeakForm, weak_form
from idloop.estimation.force_balance.weak_form import test_functions as functions
from idloop.estimation.optimisation.caching_engine import CachingEngine
from idloop.physics import Model, load_model
from idloop.physics.simulation import simulate
from idloop.records import Record

RATE = 500.0


def recorded(machine: Model, seed: int = 1, seconds: float = 8.0) -> Record:
    """Smooth motion without noise."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, seconds, 1.0 / RATE)
    command = sum(a * np.sin(2.0 * np.pi * f * time + p) for a, f, p in zip(
        rng.uniform(0.3, 1.0, 5), rng.uniform(0.2, 3.0, 5), rng.uniform(0.0, 6.0, 5), strict=True
    ))  # fmt: skip
    output = simulate(machine, time, command, time).output
    names, units = tuple(o.name for o in machine.outputs), tuple(o.unit for o in machine.outputs)
    return Record("run", time, command, time, output, "axis.effort", machine.input.unit, names, units)


def form_of(model: Model, record: Record, width: int = NARROWEST) -> WeakForm:
    form = weak_form(CachingEngine(model), prepare(model, [record]), width)
    assert form is not None
    return form


@given(st.integers(NARROWEST, 200), st.floats(1e-5, 1.0), st.floats(-1e3, 1e3), st.floats(-1e3, 1e3))
def test_a_constant_acceleration_comes_out_as_it_is(width: int, step: float, start: float, rate: float) -> None:
    value, first, second = functions(width, step)
    time = (np.arange(width) - 0.5 * (width - 1)) * step
    velocity, position = rate + 2.0 * time, start + rate * time + time**2
    assert np.sum(value) == pytest.approx(1.0)
    size = 1e-9 * (abs(start) + abs(rate) * width * step) / (width * step) ** 2 + 1e-7
    assert -first @ velocity == pytest.approx(2.0, abs=size + 1e-9 * abs(rate) / step)
    assert second @ position == pytest.approx(2.0, abs=size)


@given(st.integers(NARROWEST, 200), st.floats(1e-5, 1.0), st.integers(0, 99))
def test_an_acceleration_that_is_held_between_samples_comes_out_exactly(width: int, step: float, seed: int) -> None:
    value, first, second = functions(width, step)
    held = np.random.default_rng(seed).normal(size=width + 1)
    velocity = np.concatenate([[0.0], np.cumsum(held)])[:-1] * step
    position = np.concatenate([[0.0], np.cumsum((velocity + 0.5 * held * step) * step)])[:-1]
    before = np.concatenate([[held[0]], held[: width - 1]])
    mean = value @ (0.5 * (before + held[:width]))
    assert -first @ velocity[:width] == pytest.approx(mean, abs=1e-9)
    assert second @ position[:width] == pytest.approx(mean, abs=1e-6)


@pytest.mark.parametrize("width", [NARROWEST, 15, 41])
def test_the_true_model_leaves_nothing_unexplained(width: int) -> None:
    machine = load_model("axis")
    form = form_of(machine, recorded(machine), width)
    left = form.residual(machine.theta, 0.5 / RATE * 0.0)[:, 0]
    assert np.sqrt(np.mean(left**2)) < 0.02 * np.sqrt(np.mean(form.drive(machine.theta, 0.0) ** 2))


def test_windows_over_a_gap_are_left_out() -> None:
    machine = load_model("axis")
    record = recorded(machine)
    output = record.output.copy()
    output[1000:1100] = np.nan
    whole, holed = form_of(machine, record), form_of(machine, replace(record, output=output))
    lost = whole.starts[-1] - holed.starts[-1]
    every = round((NARROWEST - 1) / 3)
    assert 100 // every <= lost <= 100 // every + 6


def test_the_slope_along_the_command_is_the_gain_and_nothing_beyond_a_limit() -> None:
    plain = load_model("axis")
    record = recorded(plain)
    form = form_of(plain, record)
    np.testing.assert_allclose(form.slope(plain.theta, 0.0), plain.values["drive.gain"], rtol=1e-6)
    for effect, largest in (("saturation@input(limit=0.0)", 1e-9), ("dead_zone@input(width=50.0)", 1e-9)):
        model = plain.with_effects([effect])
        cut = form.with_engine(CachingEngine(model))
        assert np.max(cut.slope(model.theta, 0.0)) < largest


@pytest.mark.parametrize(
    "effect",
    [
        "coulomb_friction@axis(level=0.2)",
        "stribeck_friction@axis(coulomb=0.1,static=0.2,velocity=0.5)",
        "load_dependent_friction@axis(ratio=0.3)",
        "dead_zone@input(width=0.3)",
        "saturation@input(limit=0.4)",
    ],
)
def test_the_slope_is_what_a_small_change_of_the_command_does(effect: str) -> None:
    # Of a friction it is asked only where a body stands, unless the load raises it.
    plain, probe = load_model("axis"), 1e-6
    model, record = plain.with_effects([effect]), recorded(plain)
    form = form_of(model, record).with_rest_speed(0.3)
    other = form_of(model, replace(record, input=record.input + probe)).with_rest_speed(0.3)
    before, after = (one.residual(model.theta, 0.0)[:, 0] for one in (form, other))
    found = form.slope(model.theta, 0.0)
    # A corner lies between the one probe and the other in a window or two.
    near = np.isclose(found, np.abs(after - before) / probe, rtol=1e-3, atol=1e-3)
    assert np.mean(near) > 0.99
    assert np.ptp(found) > 0.1 or effect.startswith("load")


def test_a_long_lag_passes_little_of_the_command() -> None:
    plain = load_model("axis")
    form = form_of(plain, recorded(plain))
    gain = plain.values["drive.gain"]
    for constant, low, high in ((1e-5, 0.9, 1.1), (1.0, 0.0, 0.05)):
        model = plain.with_effects([f"actuator_lag@input(time_constant={constant})"])
        late = form.with_engine(CachingEngine(model))
        slope = np.median(late.slope(model.theta, 0.0))
        assert low * gain <= slope <= high * gain


def test_a_delay_moves_the_command_by_parts_of_a_sample() -> None:
    machine = load_model("axis").with_effects(["input_delay@input(delay=0.0071)"])
    form = form_of(machine, recorded(machine))
    theta = machine.theta
    place = machine.free.index("input_delay@input.delay")
    errors = []
    for delay in (0.0066, 0.0071, 0.0076):
        theta = theta.copy()
        theta[place] = delay
        errors.append(float(np.sum(form.residual(theta, 0.0)[:, 0] ** 2)))
    assert errors[1] < min(errors[0], errors[2])


def test_segments_have_the_windows_of_their_record() -> None:
    machine = load_model("axis")
    form = form_of(machine, recorded(machine, seconds=40.0))
    most = int(form.starts[-1]) // 5
    some = form.subsampled(most)
    assert form.subsampled(int(form.starts[-1])) is form
    assert some.starts[-1] == pytest.approx(most, rel=0.1)
    moved = machine.theta * 1.1
    place = np.searchsorted(form.along("time"), some.along("time") - 1e-9)
    assert some.along("time") == pytest.approx(form.along("time")[place])
    assert some.residual(moved, 1e-3) == pytest.approx(form.residual(moved, 1e-3)[place])


def test_segments_of_a_model_with_memory_have_a_lead_in() -> None:
    machine = load_model("axis").with_effect("actuator_lag", "input", time_constant=0.004)
    form = form_of(machine, recorded(machine, seconds=40.0))
    some = form.subsampled(int(form.starts[-1]) // 5)
    place = np.searchsorted(form.along("time"), some.along("time") - 1e-9)
    whole = form.residual(machine.theta, 0.0)[place]
    assert some.residual(machine.theta, 0.0) == pytest.approx(
        whole, abs=1e-3 * float(np.std(form.drive(machine.theta, 0.0)))
    )


def test_the_reversed_command_reverses_the_drive() -> None:
    machine = load_model("axis")
    form = form_of(machine, recorded(machine))
    assert form.with_reversed_command().drive(machine.theta, 0.0) == pytest.approx(-form.drive(machine.theta, 0.0))
