"""Measured conditions: what effects make of a temperature and a supply."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from idloop.errors import InputError
from idloop.physics import Condition, Engine, Plant, load_model, simulate
from idloop.physics.conditions import Conditions
from idloop.physics.model import Model

TIME = np.arange(0.0, 4.0, 0.01)
COMMAND = np.sign(np.sin(3.0 * TIME)) + 0.4 * np.sin(11.0 * TIME)


def temperature(low: float = 20.0, high: float = 60.0, name: str = "temperature") -> Condition:
    return Condition(name, "°C", np.array([0.0, 4.0]), np.array([low, high]))


def warm(coefficient: float = -0.02) -> Model:
    return load_model("dc_motor").with_effect("thermal_viscosity", "motor", coefficient=coefficient, reference=20.0)


def test_viscous_friction_follows_the_temperature() -> None:
    # Between commands dv/dt = (K u - (B + b (T - 20)) v) / J; midpoint steps of 0.1 ms.
    model = warm()
    p, step = model.values, 1e-4
    place = speed = 0.0
    motion = []
    for k in range(len(TIME) * 100):
        if k % 100 == 0:
            motion.append((place, speed))
            held = COMMAND[k // 100]

        def rate(v: float, at: float, held: float = held) -> float:
            viscous = p["motor.viscous_friction"] - 0.02 * 10.0 * at
            return (p["drive.gain"] * held - viscous * v) / p["motor.inertia"]

        middle = speed + 0.5 * step * rate(speed, k * step)
        place += step * middle
        speed += step * rate(middle, (k + 0.5) * step)
    run = simulate(model, TIME, COMMAND, TIME, conditions=[temperature()])
    np.testing.assert_allclose(run.output, motion, atol=2e-5)


def test_a_steady_temperature_is_another_friction() -> None:
    hot = simulate(warm(), TIME, COMMAND, TIME, conditions=[temperature(45.0, 45.0)])
    plain = load_model("dc_motor")
    thin = plain.with_values({"motor.viscous_friction": plain.values["motor.viscous_friction"] - 0.5})
    np.testing.assert_allclose(hot.output, simulate(thin, TIME, COMMAND, TIME).output, atol=1e-9)


def test_dry_friction_follows_the_temperature_and_never_drives() -> None:
    plain = load_model("dc_motor").with_effect("coulomb_friction", "motor", level=0.5)
    seizing = plain.with_effect("thermal_dry_friction", "motor", slope=-0.02, reference=20.0)
    for degrees, level in ((20.0, 0.5), (30.0, 0.3), (80.0, 0.0)):
        run = simulate(seizing, TIME, COMMAND, TIME, conditions=[temperature(degrees, degrees)])
        same = simulate(plain.with_values({"coulomb_friction@motor.level": level}), TIME, COMMAND, TIME)
        np.testing.assert_allclose(run.output, same.output, atol=1e-7)


@pytest.mark.slow
@given(share=st.floats(0.0, 2.0), volts=st.floats(0.1, 60.0), reference=st.floats(5.0, 60.0))
def test_the_drive_goes_with_a_power_of_the_supply(share: float, volts: float, reference: float) -> None:
    model = load_model("dc_motor").with_effect("supply_sag", "input", share=share, reference=reference)
    supply = Condition("supply", "V", np.zeros(1), np.array([volts]))
    run = simulate(model, TIME[:20], COMMAND[:20], TIME[:20], conditions=[supply])
    factor = 1.0 if share == 0.0 else (volts / reference) ** share
    plain = simulate(load_model("dc_motor"), TIME[:20], factor * COMMAND[:20], TIME[:20])
    np.testing.assert_allclose(run.output, plain.output, rtol=1e-9, atol=1e-12)


@pytest.mark.slow
@given(coefficient=st.floats(-0.02, 0.1), low=st.floats(-20.0, 80.0), high=st.floats(-20.0, 80.0))
def test_only_coefficient_times_deviation_counts(coefficient: float, low: float, high: float) -> None:
    # Another reference with another friction there is the same machine.
    moved = warm(coefficient).with_values(
        {
            "thermal_viscosity@motor.reference": 50.0,
            "motor.viscous_friction": max(load_model("dc_motor").values["motor.viscous_friction"], 2.0),
        }
    )
    friction = moved.values["motor.viscous_friction"] - 30.0 * coefficient
    if friction < 0.0:
        return
    cold = moved.with_values({"thermal_viscosity@motor.reference": 20.0, "motor.viscous_friction": friction})
    conditions = [temperature(low, high)]
    one, other = (simulate(m, TIME[:50], COMMAND[:50], TIME[:50], conditions=conditions) for m in (moved, cold))
    np.testing.assert_allclose(one.output, other.output, atol=1e-9)


def test_without_the_condition_an_effect_acts_as_at_its_reference() -> None:
    plain = simulate(load_model("dc_motor"), TIME, COMMAND, TIME).output
    np.testing.assert_array_equal(simulate(warm(), TIME, COMMAND, TIME).output, plain)


def test_a_plant_takes_conditions_too() -> None:
    plant = Plant(warm(), noise=False, conditions=[temperature()])
    seen = []
    for now, u in zip(TIME, COMMAND, strict=True):
        plant.advance(now)
        seen.append(plant.measure())
        plant.schedule(now, u)
    run = simulate(warm(), TIME, COMMAND, TIME, conditions=[temperature()])
    np.testing.assert_allclose(seen, run.output, atol=1e-9)


def test_a_condition_of_the_site_comes_before_the_general_one() -> None:
    own = temperature(45.0, 45.0, "motor.temperature")
    both = simulate(warm(), TIME, COMMAND, TIME, conditions=[temperature(), own])
    alone = simulate(warm(), TIME, COMMAND, TIME, conditions=[temperature(45.0, 45.0)])
    np.testing.assert_array_equal(both.output, alone.output)


def test_balance_prediction_and_slopes_know_the_condition() -> None:
    conditions = Conditions([temperature()])
    model = warm().with_free(["thermal_viscosity@motor.coefficient", "drive.gain"])
    engine = Engine(model)
    start = engine.initial_state()
    run = engine.simulate(None, TIME, COMMAND, TIME, start, conditions=conditions)
    innovation = engine.predict(None, TIME, COMMAND, TIME, run, np.zeros((3, 2)), start, conditions=conditions)
    np.testing.assert_allclose(innovation, 0.0, atol=1e-9)
    slopes = engine.slopes(model.theta, 1e-5 * np.abs(model.theta), TIME, COMMAND, TIME, start, conditions)
    assert slopes is not None
    for column in range(2):
        step = np.zeros(2)
        step[column] = 1e-5 * abs(model.theta[column])
        moved = engine.simulate(model.theta + step, TIME, COMMAND, TIME, start, conditions=conditions)
        expected = (moved - run) / step[column]
        np.testing.assert_allclose(slopes[column], expected, atol=1e-3 * np.max(np.abs(expected)))
    p, warmth = model.values, 10.0 * TIME
    acceleration = (p["drive.gain"] * COMMAND - (p["motor.viscous_friction"] - 0.02 * warmth) * run[:, 1])[:, None]
    motion = run[:, :1], run[:, 1:], acceleration
    left = engine.balance(None, *motion, TIME, COMMAND, TIME, conditions=conditions).residual
    np.testing.assert_allclose(left, 0.0, atol=1e-9)


def test_a_slow_simulation_holds_no_condition_longer_than_it_was_sampled() -> None:
    fine = np.linspace(0.0, 4.0, 401)
    swing = Condition("temperature", "°C", fine, 20.0 + 40.0 * np.sin(20.0 * fine) ** 2)
    coarse = simulate(warm(), [0.0], [1.0], [0.0, 4.0], conditions=[swing]).output[-1]
    dense = simulate(warm(), [0.0], [1.0], fine, conditions=[swing]).output[-1]
    np.testing.assert_allclose(coarse, dense, rtol=1e-6)


@pytest.mark.parametrize(
    ("time", "value", "line"),
    [
        ([], [], "at least 1"),
        ([0.0, 1.0], [20.0], "one length"),
        ([0.0, 0.0], [20.0, 21.0], "does not increase"),
        ([0.0, 1.0], [20.0, np.nan], "not finite"),
    ],
)
def test_a_bad_condition_is_refused_in_one_line(time: list[float], value: list[float], line: str) -> None:
    with pytest.raises(InputError, match=line):
        Condition("temperature", "°C", np.array(time), np.array(value))


def test_a_condition_that_is_not_there_is_named() -> None:
    supply = Condition("supply", "V", np.zeros(1), np.full(1, 24.0))
    with pytest.raises(InputError, match="no condition 'temperature'; there are supply"):
        simulate(warm(), TIME, COMMAND, TIME, conditions=[supply])


@given(
    st.lists(st.floats(0.0, 10.0), min_size=1, max_size=20, unique=True),
    st.floats(0.0, 10.0),
    st.floats(0.0, 10.0),
)
def test_a_cut_changes_no_value_within_it(stamps: list[float], one: float, other: float) -> None:
    time = np.array(sorted(stamps))
    whole = Condition("supply", "V", time, np.cos(time))
    low, high = min(one, other), max(one, other)
    inside = np.linspace(low, high, 7)
    np.testing.assert_allclose(whole.cut(low, high).at(inside), whole.at(inside), atol=1e-12)
