"""Data in which the motion has nothing to do with the command: no effect is named on them, and a finding reports it."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from tests.diagnosis.conftest import record_of

from idloop.diagnosis import Ladder, diagnose, refine
from idloop.diagnosis.screening.command_response import (
    CommandResponse,
    command_response,
    responds_to_command,
    responds_to_reversed_command,
)
from idloop.diagnosis.search.step import NOT_EXCITED
from idloop.estimation.likelihood.estimation_problem import prepare_estimation
from idloop.estimation.likelihood.refit import refit
from idloop.physics import Model, load_model
from idloop.physics.simulation import simulate
from idloop.records import Record
from idloop.reporting.verdicts import conclusion, ending

FRICTION = "coulomb_friction@axis(level=0.3)"


def unrelated_motion(machine: Model, seed: int) -> Record:
    """The motion of one run beside the command of another."""
    run, other = (record_of(machine, one, seconds=20.0, disturbance=0.02) for one in (seed, seed + 100))
    return replace(run, input=other.input)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
def test_columns_of_two_runs_are_reported_and_no_effect_is_named(start, seed):
    machine = start.with_effects([FRICTION])
    records = [unrelated_motion(machine, seed), unrelated_motion(machine, seed + 10)]
    found = diagnose(start, records)
    assert found.set == ()
    assert found.verdict == NOT_EXCITED
    assert found.response is CommandResponse.UNMOVED
    assert found.response.text in found.gate.findings
    assert "says nothing about the axis" in ending(found.verdict, "", found.response)


@pytest.mark.slow
def test_a_ladder_climbs_nothing_on_them(start):
    machine = start.with_effects([FRICTION])
    ladder = refine(start, [unrelated_motion(machine, 1)], [unrelated_motion(machine, 11)])
    assert ladder.added == ()
    assert ladder.response is CommandResponse.UNMOVED
    assert Ladder.from_dict(ladder.to_dict()).response is ladder.response
    assert conclusion(ladder).startswith("the measured motion does not follow the command")


def reversed_sign(seed: int) -> Record:
    """A machine that runs the other way than its command counts."""
    record = record_of(load_model("axis").with_effects([FRICTION]), seed, seconds=20.0, disturbance=0.02)
    return replace(record, input=-record.input)


@pytest.mark.slow
def test_a_reversed_command_is_the_only_finding(start):
    found = diagnose(start, [reversed_sign(3)])
    assert found.response is CommandResponse.REVERSED
    assert (found.set, found.verdict, found.unknown) == ((), NOT_EXCITED, None)
    assert any("`scale: -1`" in text for text in found.gate.findings)
    ladder = refine(start, [reversed_sign(3)], [reversed_sign(13)])
    assert ladder.added == ()
    assert conclusion(ladder) == "the measured motion follows minus the command: turn one of the two, then ask again"


@pytest.mark.slow
def test_a_gain_that_may_be_negative_becomes_so_and_the_effect_is_found(start):
    free = start.with_free([*(name for name in start.free if name != "axis.inertia"), "drive.gain"])
    ladder = refine(free, [reversed_sign(3)], effects=["coulomb_friction", "input_offset"])
    assert ladder.added == ("coulomb_friction@axis",)
    assert any("drive.gain is -" in text and "`scale: -1`" in text for text in ladder.findings)


@pytest.mark.slow
def test_a_servo_whose_own_loop_saturates_follows_its_command():
    """No model of ours has a loop in the drive; the command is far from the motion, and still it is what moves it."""
    time = np.arange(0.0, 6.0, 0.02)
    records = []
    for seed in (1, 2):
        rng = np.random.default_rng(seed)
        command = 0.6 * np.sign(rng.normal(size=len(time) // 5)).repeat(5)
        position = np.zeros_like(time)
        for k in range(2, len(time)):
            position[k] = position[k - 1] + 0.02 * np.clip(15.0 * (command[k - 2] - position[k - 1]), -1.5, 1.5)
        output = (position + 5e-4 * rng.normal(size=len(time)))[:, None]
        records.append(Record("servo", time, command, time, output, "axis.effort", "rad", ("axis.position",), ("rad",)))
    (position,) = (one for one in load_model("axis").outputs if one.field == "position")
    servo = replace(load_model("axis"), outputs=(position,)).with_effects(["cable_spring@axis(stiffness=300.0)"])
    servo = servo.with_values({"axis.inertia": 1.0, "drive.gain": 300.0, "axis.viscous_friction": 30.0})
    servo = servo.with_free([*(name for name in servo.free if name != "axis.inertia"), "drive.gain"])
    found = diagnose(servo, records)
    assert not found.response.uninformative
    assert found.verdict != NOT_EXCITED


@pytest.mark.parametrize("turn", [1.0, -1.0])
def test_the_command_response_of_related_and_unrelated_data(start, turn):
    record = record_of(start, 3, disturbance=0.02)
    record = replace(record, input=turn * record.input)
    assert command_response(start, [record]) is (CommandResponse.FOLLOWS if turn > 0.0 else CommandResponse.REVERSED)
    assert command_response(start, [unrelated_motion(start, 1)]) is CommandResponse.UNMOVED


def test_a_gain_that_turns_with_the_command_shows_no_reversed_one(start):
    record = record_of(start, 3, disturbance=0.02)
    poor = SimpleNamespace(log_likelihood=-np.inf)
    free = start.with_free([*start.free, "drive.gain"])
    # Fitted to minus the command, the free gain is negative: the same model.
    for model, turned in ((free, False), (start, False)):
        estimation = prepare_estimation(model, [record], "prediction")
        assert responds_to_reversed_command(estimation, poor, model) is turned
    estimation = prepare_estimation(start, [replace(record, input=-record.input)], "prediction")
    assert responds_to_reversed_command(estimation, poor, start)


@pytest.mark.parametrize("kind", ["prediction", "simulation", "force"])
def test_a_machine_under_command_follows_by_every_criterion(start, kind):
    record = record_of(start.with_effects([FRICTION]), 3, disturbance=0.02)
    estimation = prepare_estimation(start, [record], kind)
    assert responds_to_command(estimation, refit(estimation, start))


def test_steps_from_rest_are_followed_though_each_has_one_command(start):
    records = [record_of(start, seed, command=np.full(300, float(seed))) for seed in (1, 2, 3)]
    estimation = prepare_estimation(start, records, "prediction")
    assert responds_to_command(estimation, refit(estimation, start))


def test_a_disturbance_as_strong_as_the_command_hides_nothing_of_it(start):
    record = record_of(start, 3, seconds=20.0, disturbance=1.0)
    estimation = prepare_estimation(start, [record], "prediction")
    assert responds_to_command(estimation, refit(estimation, start))
    found = diagnose(start, [record], effects=["coulomb_friction"])
    assert not found.response.uninformative


@np.errstate(over="ignore", invalid="ignore")
def test_the_model_with_the_missing_effect_may_be_the_first_that_follows(start):
    """A delay of 0.4 s under a command that is forgotten by then: the plain model predicts no better with it."""
    machine = start.with_effects(["input_delay@input(delay=0.4)"])
    command = np.random.default_rng(5).normal(size=600).repeat(4)
    record = record_of(machine, 5, command=command)
    estimation = prepare_estimation(start, [record], "prediction")
    plain = refit(estimation, start)
    assert not responds_to_command(estimation, plain)
    assert responds_to_command(estimation, refit(estimation, machine, None, plain))


def test_a_motion_with_late_stamps_follows_the_command() -> None:
    """One sample ahead, an exact position at a stamp that is late hides what the command does."""
    model, time, chance = load_model("axis"), np.arange(0.0, 40.0, 0.005), np.random.default_rng(14)
    command = chance.uniform(-0.5, 0.5, 400)[np.arange(time.size) // 20]
    noise = np.array([0.0, 0.05]) * chance.normal(size=(time.size, 2))
    output = simulate(model, time, command, time, noise=noise).output
    time = time + 4e-4 * chance.normal(size=time.size)
    names, units = ("axis.position", "axis.velocity"), ("rad", "rad/s")
    record = Record("late", time, command, time, output, "axis.effort", "N·m", names, units)
    assert command_response(model, [record]) is CommandResponse.FOLLOWS
    estimation = prepare_estimation(model, [record], "prediction")
    assert responds_to_command(estimation, refit(estimation, model))
