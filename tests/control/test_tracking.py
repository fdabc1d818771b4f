"""Following a reference: what is wanted of each output, and the sizes of the error."""

from __future__ import annotations

import numpy as np
import pytest

from idloop.control import build_controller, check_controller
from idloop.control.compensation import Compensation
from idloop.control.tracking import Tracking, track, wanted_outputs
from idloop.physics import Plant, load_model

PERIOD = 0.001
# Gains on a moving reference and against noise, added to the controller of the axis.
SMOOTH = {"velocity_feedforward": 0.3, "derivative_filter": 0.005}


def moves(amplitude, cycles=2.0, seconds=4.0):
    """Position and velocity of a sine, from the controller's first sample on."""
    time = np.arange(round(seconds / PERIOD)) * PERIOD
    rate = 2.0 * np.pi * cycles / seconds
    return np.column_stack([amplitude * np.sin(rate * time), amplitude * rate * np.cos(rate * time)])


def test_every_body_is_to_stand_where_the_reference_says():
    model = load_model("torsion")
    values = check_controller({**model.controller, "feedback_gain": 2.0})
    assert np.array_equal(wanted_outputs(model, values, np.array([[1.0, 9.0]])), [[0.5] * 4])
    axis = load_model("axis")
    speed = check_controller({"type": "p", "output": "axis.velocity", "kp": 1.0, "sample_time": 0.001})
    wanted = wanted_outputs(axis, speed, np.array([[1.0, 9.0]]))
    assert np.isnan(wanted[0, 0])
    assert wanted[0, 1] == 9.0
    assert np.all(np.isnan(wanted_outputs(axis, check_controller(None), np.zeros((3, 2)))))


def test_sizes_of_an_error_count_from_the_settling_time_on():
    time = np.arange(4.0)
    run = Tracking(time, np.zeros((4, 1)), np.array([[9.0], [1.0], [-3.0], [1.0]]), time, ("a.position",), ("m",))
    error = run.error_of("a.position", 1.0)
    assert (error.rms, error.largest, error.mean) == (pytest.approx((11.0 / 3.0) ** 0.5), 3.0, pytest.approx(-1.0 / 3))


@pytest.mark.parametrize(
    ("name", "effects", "more"),
    [
        ("axis", ["dead_zone@input(width=0.3)", "coulomb_friction@axis(level=0.15)"], SMOOTH),
        ("axis", ["input_offset@input(offset=0.2)", "gain_asymmetry@input(ratio=0.3)"], SMOOTH),
        ("axis", ["imbalance@axis(amplitude=0.2)", "cogging@axis(amplitude=0.1,harmonic=6)"],
         SMOOTH),
        ("axis", ["stribeck_friction@axis(coulomb=0.1,static=0.15,velocity=0.1)"], SMOOTH),
        ("axis", ["presliding_friction@axis(level=0.15,stiffness=50.0)"], SMOOTH),
        ("axis", ["load_dependent_friction@axis(ratio=0.2)", "load_torque@axis(torque=-0.2)"],
         SMOOTH),
        ("torsion", ["input_offset@input(offset=0.0397)"], {"velocity_feedforward": 0.8, "derivative_filter": 0.005}),
    ],
)  # fmt: skip
def test_with_compensation_the_machine_moves_like_its_linear_part(name, effects, more):
    linear = load_model(name)
    machine = linear.with_effects(effects)
    section = {**linear.controller, **more}
    # Slow enough for what the linear loop leaves to be small.
    reference = moves(0.2, cycles=1.0)
    bare, known = build_controller(section), build_controller(section, compensation=Compensation(machine))
    without = track(Plant(machine, noise=False), bare, reference)
    compensated = track(Plant(machine, noise=False), known, reference)
    aim = track(Plant(linear, noise=False), bare, reference)
    output = bare.parameters["output"]
    before, after, least = (run.error_of(output, 0.5).rms for run in (without, compensated, aim))
    # What compensation can gain is what the effects cost: nearly all of that.
    assert after <= 0.5 * before
    assert after - least <= 0.2 * (before - least)


def test_the_far_side_of_a_gap_follows_when_the_reference_takes_the_step():
    # Friction holds the load: without compensation it stands half of the gap behind.
    torsion = load_model("torsion")
    machine = torsion.with_effects(["backlash@motor-load1(gap=0.04)", "coulomb_friction@load1(level=0.02)"])
    section = {**torsion.controller, "velocity_feedforward": 0.8, "derivative_filter": 0.005}
    reference = moves(0.5, cycles=1.0)
    runs = [
        track(Plant(machine, noise=False), build_controller(section, compensation=known), reference)
        for known in (None, Compensation(machine))
    ]
    before, after = (run.error_of("load1.position", 1.0).rms for run in runs)
    assert after < 0.6 * before


def test_a_run_begins_anew_with_the_controller():
    model = load_model("axis")
    controller = build_controller({**model.controller, "type": "pid", "ki": 3.0})
    first = track(Plant(model, noise=False), controller, moves(0.5))
    again = track(Plant(model, noise=False), controller, moves(0.5))
    assert np.array_equal(first.output, again.output)
    assert np.array_equal(first.command, again.command)
    assert first.followed == ("axis.position",)


def test_a_push_across_a_play_brings_the_reading_back_at_once():
    machine = load_model("axis").with_effects(
        ["backlash@position[axis](gap=0.05)", "coulomb_friction@axis(level=0.05)"]
    )
    section = {"type": "pid", "output": "axis.position", "kp": 4.0, "ki": 4.0, "kd": 0.2, "derivative_filter": 0.01,
               "velocity_feedforward": 0.2, "limit": 5.0, "sample_time": 0.001}  # fmt: skip
    largest = {}
    for effects in (("coulomb_friction",), ()):
        known = build_controller(section, compensation=Compensation(machine, effects))
        run = track(Plant(machine, noise=False), known, moves(0.3, cycles=2.0))
        largest[effects] = run.error_of("axis.position", 1.0).largest
    assert largest[()] < 0.5 * largest[("coulomb_friction",)]
