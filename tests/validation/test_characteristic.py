"""The characteristic of an effect, read off a record in which it acts: its own curve, with the data on it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from idloop.errors import InputError
from idloop.physics import load_model, simulate
from idloop.records import Record
from idloop.validation.characteristic import characteristic, no_picture

TIME = np.arange(0.0, 20.0, 2e-3)


def recorded(model, seed: int = 3, offset: float = 0.0) -> Record:
    random = np.random.default_rng(seed)
    frequency, phase = np.array([0.17, 0.41, 0.83]), random.uniform(0.0, 6.0, 3)
    command = offset + 2.0 * np.sum(np.sin(2.0 * np.pi * frequency * TIME[:, None] + phase), axis=1)
    output = simulate(model, TIME, command, TIME).output
    output = output + 1e-4 * random.normal(size=output.shape)
    return Record(
        "r", TIME, command, TIME, output, model.input.name, model.input.unit, model.output_names,
        tuple(o.unit for o in model.outputs),
    )  # fmt: skip


def shown(effect: str, offset: float = 0.0):
    model = load_model("dc_motor").with_effects([effect])
    one = characteristic(model, effect.partition("(")[0], recorded(model, offset=offset))
    assert one is not None
    return one


def explained(one) -> float:
    """Part of the points' variance that the fitted curve accounts for."""
    return 1.0 - float(np.var(one.y - np.interp(one.x, one.curve_x, one.curve_y)) / np.var(one.y))


def test_dry_friction_is_a_step_over_velocity():
    one = shown("coulomb_friction@motor(level=3)")
    assert (one.variable, one.unit) == ("velocity", "rad/s")
    assert (one.quantity, one.quantity_unit) == ("further force needed", "N·m")
    np.testing.assert_allclose(one.curve_y, 3.0 * np.sign(one.curve_x), atol=1e-9)
    outer = np.abs(one.centre) > 1.0
    np.testing.assert_allclose(one.mean[outer], 3.0 * np.sign(one.centre[outer]), atol=0.3)
    assert explained(one) > 0.9


def test_friction_of_a_machine_that_stands_half_of_the_time_stays_within_its_static_level():
    effect = "stribeck_friction@axis(coulomb=0.2,static=0.35,velocity=0.8)"
    model = load_model("axis").with_effects([effect])
    random = np.random.default_rng(2)
    command = 0.45 * random.uniform(-1.0, 1.0, 41)[(2.0 * TIME).astype(int)]
    output = simulate(model, TIME, command, TIME).output
    assert np.mean(output[:, 1] == 0.0) > 0.4
    output = output + np.array([5e-4, 0.02]) * random.normal(size=output.shape)
    record = replace(recorded(load_model("axis")), input=command, output=output)
    one = characteristic(model, "stribeck_friction@axis", record)
    assert one is not None
    level = 0.2 + 0.15 * np.exp(-((one.curve_x / 0.8) ** 2))
    np.testing.assert_allclose(one.curve_y, level * np.sign(one.curve_x), atol=1e-3)
    assert np.max(np.abs(one.mean)) < 0.4
    assert explained(one) > 0.8


@pytest.mark.parametrize("effect", ["input_delay@input(delay=0.02)", "actuator_lag@input(time_constant=0.02)"])
def test_a_late_command_has_no_curve(effect):
    model = load_model("dc_motor").with_effects([effect])
    assert characteristic(model, effect.partition("(")[0], recorded(model)) is None


def test_a_dead_zone_takes_its_width_from_the_command():
    one = shown("dead_zone@input(width=0.3)")
    assert (one.variable, one.unit, one.quantity_unit) == ("command", "V", "V")
    lost = -np.clip(one.curve_x, -0.3, 0.3)
    np.testing.assert_allclose(one.curve_y, lost, atol=1e-9)
    np.testing.assert_allclose(one.mean, -np.clip(one.centre, -0.3, 0.3), atol=0.1)


def test_friction_beside_it_does_not_hide_an_offset_of_the_command():
    model = load_model("dc_motor").with_effects(["coulomb_friction@motor(level=3)", "input_offset@input(offset=0.2)"])
    one = characteristic(model, "input_offset@input", recorded(model))
    assert one is not None
    assert one.quantity == "change of the command"
    np.testing.assert_allclose(one.curve_y, 0.2, atol=1e-9)


def test_a_large_change_of_the_command_is_shown_as_the_command_that_acts():
    one = shown("saturation@input(limit=2)")
    assert one.quantity == "command that acts"
    np.testing.assert_allclose(one.curve_y, np.clip(one.curve_x, -2.0, 2.0), atol=1e-9)


def test_imbalance_is_a_wave_over_the_turn():
    one = shown("imbalance@motor(amplitude=4)", offset=1.0)
    assert (one.variable, one.unit, one.circular) == ("angle of the turn", "°", True)
    np.testing.assert_allclose(one.curve_y, 4.0 * np.sin(np.radians(one.curve_x)), atol=1e-9)
    np.testing.assert_allclose(one.mean, 4.0 * np.sin(np.radians(one.centre)), atol=0.6)


def test_a_force_that_repeats_along_the_travel_is_a_wave_over_its_period():
    """Over the velocity, or over many periods of travel, it was a tangle that nobody could read."""
    name = "periodic_force@axis"
    model = load_model("axis").with_effects([f"{name}(amplitude=0.02,period=1.5,phase=0.5)"])
    slow = recorded(load_model("axis"))
    command = 0.08 * slow.input
    output = simulate(model, TIME, command, TIME).output
    assert np.ptp(output[:, 0]) > 3.0
    record = replace(slow, input=command, output=output + 1e-6 * np.random.default_rng(4).normal(size=output.shape))
    one = characteristic(model, name, record)
    assert one is not None
    assert (one.variable, one.unit) == ("position within a period", "rad")
    assert np.ptp(one.x) <= 1.5
    np.testing.assert_allclose(one.curve_y, 0.02 * np.sin(2.0 * np.pi * one.curve_x / 1.5 + 0.5), atol=1e-6)


def test_a_spring_that_is_wound_over_turns_is_a_line_over_the_position():
    one = shown("cable_spring@motor(stiffness=0.5,rest=0)")
    assert np.ptp(one.curve_x) > 2.0 * np.pi
    assert (one.variable, one.unit, one.circular) == ("position", "rad", False)
    np.testing.assert_allclose(one.curve_y, 0.5 * one.curve_x, atol=1e-6)


def test_a_constant_load_is_a_level_line():
    one = shown("load_torque@motor(torque=-2)")
    np.testing.assert_allclose(one.curve_y, 2.0, atol=1e-9)
    assert np.median(one.mean) == pytest.approx(2.0, abs=0.1)


def test_backlash_before_a_sensor_is_half_the_gap_to_either_side():
    one = shown("backlash@position[motor](gap=0.4)")
    assert one.quantity == "reading, less the true value"
    assert np.max(np.abs(one.curve_y)) == pytest.approx(0.2, abs=1e-3)
    assert np.percentile(np.abs(one.y), 90) == pytest.approx(0.2, abs=1e-3)


def test_an_offset_of_a_sensor_is_a_level_line():
    one = shown("sensor_offset@position[motor](offset=0.3)")
    assert one.curve_y == pytest.approx(0.3, rel=0.01)
    assert one.mean == pytest.approx(0.3, rel=0.01)


def test_backlash_between_bodies_passes_nothing_inside_the_gap():
    model = load_model("torsion").with_effects(["backlash@motor-load1(gap=0.1)"])
    one = characteristic(model, "backlash@motor-load1", recorded(model))
    assert one is not None
    assert (one.variable, one.quantity) == ("twist", "torque that passes")
    inside = np.abs(one.centre) < 0.03
    assert np.any(inside)
    assert np.max(np.abs(one.mean[inside])) < 0.2 * np.max(np.abs(one.mean))


def test_without_a_measured_motion_there_is_no_picture():
    model = load_model("torsion").with_effects(["coulomb_friction@motor(level=0.01)"])
    record = recorded(model)
    hidden = record.output.copy()
    hidden[:, 2] = np.nan
    assert characteristic(model, "coulomb_friction@motor", replace(record, output=hidden)) is None


def test_an_effect_without_a_characteristic_is_refused():
    model = load_model("dc_motor")
    with pytest.raises(InputError, match="no effect"):
        characteristic(model, "dead_zone@input", recorded(model))


def test_the_reason_for_no_picture_of_a_sensor_speaks_of_its_reading():
    model = load_model("axis").with_effects(["sensor_quantisation@position[axis](resolution=0.001)"])
    assert no_picture("sensor_quantisation@position[axis]", model).startswith("it changes the reading")
