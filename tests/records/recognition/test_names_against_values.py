"""A header whose names are exchanged is doubted, and one whose names hold is not."""

from __future__ import annotations

import shlex
from itertools import permutations
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter

from idloop.errors import InputError
from idloop.records.recognition.guess import Given
from idloop.records.recognition.recognise import recognise_table
from idloop.records.tables.table import Table

T = np.arange(3000) * 0.005
NAMES = {"command": "u", "position": "position", "velocity": "velocity"}


def _signals(seed):
    """Command, position and velocity of an axis with inertia and friction, with the noise of sensors."""
    rng = np.random.default_rng(seed)
    command = np.repeat(rng.normal(size=100), 30)
    speed = lfilter([0.0, 0.02], [1.0, -0.98], command)
    noise = rng.normal(size=(2, T.size))
    place = np.cumsum(speed) * 0.005
    return {"command": command, "position": place + 1e-4 * noise[0], "velocity": speed + 1e-2 * noise[1]}


def _doubt(columns, **given):
    found = recognise_table(Table(Path("log.csv"), {"t [s]": T, **columns}), given)
    return next((one for one in found.all_doubts() if "the names may be exchanged" in one), "")


@pytest.mark.parametrize("order", [one for one in permutations(NAMES) if one[1] != "position"])
def test_exchanged_names_are_doubted_with_the_options_that_mend_it(order):
    for seed in range(5):
        signals = _signals(seed)
        columns = {name: signals[one] for name, one in zip(NAMES.values(), order, strict=True)}
        doubt = _doubt(columns)
        right = dict(zip(order, NAMES.values(), strict=True))
        for role in ("position", "velocity"):
            assert f"--{role} '{right[role]}'" in doubt
        assert ("--command" in doubt) is (right["command"] != "u")
        assert not _doubt(columns, **{role: Given(name) for role, name in right.items()})


WRITTEN = {"command": "torque_Nm", "position": "angle_deg", "velocity": "velocity_rad_s"}
UNITS = {"command": "N·m", "position": "deg", "velocity": "rad/s"}


@pytest.mark.parametrize("order", [one for one in permutations(NAMES) if one[1] != "position"])
def test_the_options_for_exchanged_names_say_the_units_and_hold_when_they_are_typed(order):
    signals = _signals(1)
    signals["position"] = np.degrees(signals["position"])
    columns = {name: signals[one] for name, one in zip(WRITTEN.values(), order, strict=True)}
    words = shlex.split(_doubt(columns).partition("if they are, ")[2])
    given = {
        option.removeprefix("--"): Given.parse(said, list(columns))
        for option, said in zip(words[::2], words[1::2], strict=True)
    }
    read = recognise_table(Table(Path("log.csv"), {"t [s]": T, **columns}), given)
    assert {role: read.of(role).unit for role in UNITS} == UNITS
    assert {role: read.of(role).column for role in UNITS} == dict(zip(order, WRITTEN.values(), strict=True))
    assert not read.all_doubts()


@pytest.mark.parametrize("given", [{}, {"velocity": Given("angle_deg", "deg/s")}])
def test_a_motion_in_the_unit_of_another_quantity_is_refused_with_its_column_and_the_option(given):
    columns = {name: _signals(1)[role] for role, name in WRITTEN.items()}
    with pytest.raises(
        InputError, match=r"^the position 'velocity_rad_s': rad/s is not .*--position 'velocity_rad_s=UNIT'"
    ):
        recognise_table(Table(Path("log.csv"), {"t [s]": T, **columns}), {"position": Given("velocity_rad_s"), **given})


WRONG = {
    "right": lambda v, rng: v,
    "of another joint": lambda v, rng: lfilter([0.02], [1.0, -0.98], rng.normal(size=v.size)),
    "noise": lambda v, rng: v + 2.0 * rng.normal(size=v.size),
    "late": lambda v, rng: np.roll(v, 60),
    "filtered": lambda v, rng: lfilter([0.01], [1.0, -0.99], v),
    "without a sign": lambda v, rng: np.abs(v),
}


@pytest.mark.parametrize("kind", WRONG)
@pytest.mark.parametrize("seed", range(5))
def test_a_wrong_velocity_beside_forces_and_an_acceleration_is_no_exchange(kind, seed):
    signals, rng = _signals(seed), np.random.default_rng(100 + seed)
    further = {
        "acc": np.gradient(signals["velocity"], T),
        "measured current": signals["command"] - 0.3 * signals["velocity"],
        "target position": signals["position"] + 0.01,
        "target velocity": np.gradient(signals["position"] + 0.01, T),
    }
    columns = {NAMES[role]: value for role, value in signals.items()} | further
    assert not _doubt(columns | {"velocity": WRONG[kind](signals["velocity"], rng)})


def test_a_position_that_stands_still_beside_other_motions_is_no_error():
    signals = _signals(1)
    columns = {"u": signals["command"], "position": 0.0 * T, "velocity": np.random.default_rng(1).normal(size=T.size)}
    assert "--position 'a'" in _doubt(columns | {"a": signals["position"], "b": signals["velocity"]})


@pytest.mark.parametrize("kind", ["right", "of another joint", "noise", "filtered"])
@pytest.mark.parametrize("seed", range(5))
def test_no_column_is_both_the_velocity_and_unrelated_to_the_slope_of_the_position(kind, seed):
    signals, rng = _signals(seed), np.random.default_rng(100 + seed)
    columns = {"t [s]": T} | {NAMES[role]: value for role, value in signals.items()}
    columns["velocity"] = WRONG[kind](signals["velocity"], rng)
    found = recognise_table(Table(Path("log.csv"), columns))
    said = [one for one in found.all_doubts() if "unrelated to the slope" in one]
    assert len(said) == (kind == "of another joint")
    assert (found.of("velocity") is None) == bool(said)
    assert ("velocity" in found.other) == bool(said)
    kept = recognise_table(Table(Path("log.csv"), columns), {"velocity": Given("velocity", "rad/s")})
    assert kept.of("velocity").column == "velocity"
