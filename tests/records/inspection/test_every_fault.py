"""Each fault of the guide, planted in the recording of one axis, is named with evidence and cure; its twin has none."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter

from idloop.records import compare_inspections, inspect_bag, make_stream, write_bag

COUNT, RATE = 3000, 200.0
RANDOM = np.random.default_rng(7)
STEPS = np.repeat(np.random.default_rng(0).normal(size=COUNT // 40), 40)
SINES = np.sin(0.6 * np.arange(COUNT) / RATE) + 0.7 * np.sin(1.7 * np.arange(COUNT) / RATE + 1.0)


@dataclass(frozen=True)
class Log:
    """What the axis and its command were at each sample, and when it was stamped and received [ns]."""

    position: np.ndarray
    velocity: np.ndarray
    command: np.ndarray
    stamp: np.ndarray
    command_stamp: np.ndarray
    receive: np.ndarray | None = None

    def write(self, path: Path) -> Path:
        states = {"j": {"position": self.position, "velocity": self.velocity}}
        return write_bag(
            path,
            [
                make_stream("joint_command", self.command_stamp, {"j": {"effort": self.command}}, self.receive),
                make_stream("joint_states", self.stamp, states, None if self.receive is None else self.receive),
            ],
        )


@cache
def log(drive: Callable[[np.ndarray], np.ndarray] = np.asarray, kind: str = "steps", gain: float = 50.0) -> Log:
    """Simulate the axis under what its drive makes of the command."""
    commands = {"steps": STEPS, "sines": SINES, "cut": np.clip(SINES, -0.8, 0.8), "levels": np.sign(STEPS)}
    command = commands.get(kind, SINES).copy()
    loop = kind == "loop"
    limit = 2.0 if drive is speed_limited else np.inf
    rng = np.random.default_rng(1)
    position, velocity, p, v = np.empty(COUNT), np.empty(COUNT), 0.0, 0.0
    applied = drive(command)
    for k in range(COUNT):
        position[k], velocity[k] = p + 2e-4 * rng.normal(), v + 5e-3 * rng.normal()
        if loop:
            applied[k] = command[k] = 4.0 * (SINES[k] - position[k]) - 0.1 * velocity[k]
        for _ in range(4):
            v += 0.25 / RATE * (gain * applied[k] - 5.0 * v - 4.0 * math.tanh(v / 0.01))
            v = float(np.clip(v, -limit, limit))
            p += 0.25 / RATE * v
    stamp = 10**9 + (1e9 * np.arange(COUNT) / RATE).astype(np.int64)
    return Log(position, velocity, command, stamp, stamp)


def speed_limited(command: np.ndarray) -> np.ndarray:
    return command


def power_limited(command: np.ndarray) -> np.ndarray:
    return np.clip(command, -0.6, 0.6)


def rate_limited(command: np.ndarray) -> np.ndarray:
    found, applied = [], 0.0
    for value in command:
        applied += float(np.clip(value - applied, -0.05, 0.05))
        found.append(applied)
    return np.array(found)


def pushed(command: np.ndarray) -> np.ndarray:
    """A force that nobody commands acts for 0.2 s."""
    return at(command, [*range(1700, 1740)], 1.0)


def held(one: Log, old: np.ndarray) -> Log:
    fresh = np.maximum.accumulate(np.where(old, 0, np.arange(COUNT)))
    return replace(one, position=one.position[fresh], velocity=one.velocity[fresh])


def jumps(one: Log, rows: list[int], size: float) -> np.ndarray:
    shift = np.zeros(COUNT)
    shift[rows] = size
    return one.position - np.cumsum(shift)


def two_publishers(one: Log) -> Log:
    stamp = np.concatenate([one.stamp, one.stamp[::5] + 2_000_000])
    order = np.argsort(stamp)
    position = np.concatenate([one.position, np.full(COUNT // 5, 99.0)])[order]
    velocity = np.concatenate([one.velocity, np.zeros(COUNT // 5)])[order]
    return replace(one, stamp=stamp[order], position=position, velocity=velocity)


def lost(one: Log) -> Log:
    rows = np.flatnonzero(np.random.default_rng(0).uniform(size=COUNT) > 0.02)
    return replace(one, stamp=one.stamp[rows], position=one.position[rows], velocity=one.velocity[rows])


def at(value: np.ndarray, rows: list[int], add: float) -> np.ndarray:
    changed = value.copy()
    changed[rows] += add
    return changed


def stuck(value: np.ndarray, first: int, last: int) -> np.ndarray:
    changed = value.copy()
    changed[first:last] = value[first]
    return changed


def rounded(value: np.ndarray, steps: int) -> np.ndarray:
    step = np.ptp(value) / steps
    return step * np.round(value / step)


late = np.minimum(RANDOM.exponential(0.001, size=COUNT), 0.0045)
noise = RANDOM.normal(size=COUNT)
FAULTS = {
    "velocity in rpm": ("wrong_velocity", "steps", lambda x: replace(x, velocity=30 / np.pi * x.velocity)),
    "velocity with its sign turned": ("wrong_velocity", "steps", lambda x: replace(x, velocity=-x.velocity)),
    "velocity constant": ("wrong_velocity", "steps", lambda x: replace(x, velocity=0.0 * x.velocity)),
    "velocity 10 % too large": ("wrong_velocity", "steps", lambda x: replace(x, velocity=1.1 * x.velocity)),
    "velocity behind a filter": (
        "late_velocity",
        "steps",
        lambda x: replace(x, velocity=lfilter([0.1], [1.0, -0.9], x.velocity)),
    ),
    "command without its sign": ("sign_lost", "steps", lambda x: replace(x, command=np.abs(x.command))),
    "command turned": ("turned_command", "steps", lambda x: replace(x, command=-x.command)),
    "a copy of the velocity": ("copied_motion", "steps", lambda x: replace(x, command=0.3 * x.velocity)),
    "two publishers": ("two_publishers", "steps", two_publishers),
    "two clocks": (
        "two_clocks",
        "steps",
        lambda x: replace(x, stamp=x.stamp + 10**9, command_stamp=x.stamp + 17 * 10**17, receive=x.stamp + 17 * 10**17),
    ),
    "a receive clock": (
        "wrong_stamps",
        "steps",
        lambda x: replace(x, stamp=x.stamp + (1e9 * late).astype(np.int64)),
    ),
    "lost samples": ("lost_samples", "steps", lost),
    "repeated samples": ("repeated_samples", "steps", lambda x: held(x, np.arange(COUNT) % 20 == 7)),
    "a position that stands still for a while": (
        "stuck_sensor",
        "steps",
        lambda x: replace(x, position=stuck(x.position, 1200, 1800)),
    ),
    "a velocity that stands still to the end": (
        "stuck_sensor",
        "steps",
        lambda x: replace(x, velocity=stuck(x.velocity, COUNT // 2, COUNT)),
    ),
    "pulses missed": (
        "missed_pulses",
        "steps",
        lambda x: replace(x, position=jumps(x, [400, 900, 1700, 2500], 0.02 * np.ptp(x.position))),
    ),
    "pulses doubled": (
        "missed_pulses",
        "steps",
        lambda x: replace(x, position=jumps(x, [400, 900, 1700, 2500], -0.02 * np.ptp(x.position))),
    ),
    "two recordings joined": (
        "spliced",
        "steps",
        lambda x: replace(x, position=jumps(x, [COUNT // 2], 0.2 * np.ptp(x.position))),
    ),
    "single bad readings": (
        "spikes",
        "steps",
        lambda x: replace(x, position=at(x.position, [700, 1400], 0.05 * np.ptp(x.position))),
    ),
    "an overflow": ("spikes", "steps", lambda x: replace(x, velocity=at(x.velocity, [1400], 65535.0))),
    "quantisation": ("coarse", "steps", lambda x: replace(x, position=rounded(x.position, 50))),
    "saturation": ("saturated_command", "sines", lambda _: log(kind="cut")),
    "a drive with a limit": ("not_followed", "steps", lambda _: log(power_limited)),
    "a drive with a rate limit": ("not_followed", "steps", lambda _: log(rate_limited)),
    "a drive with a speed limit": ("not_followed", "steps", lambda _: log(speed_limited)),
    "a push from outside": ("outside_force", "steps", lambda _: log(pushed)),
    "another machine from the middle on": (
        "changed_machine",
        "steps",
        lambda x: replace(x, command=np.where(np.arange(COUNT) < COUNT // 2, 1.0, 0.5) * x.command),
    ),
    "measured, not commanded": (
        "measured_input",
        "steps",
        lambda x: replace(x, command=0.5 * (x.command + np.append(x.command[0], x.command[:-1]))),
    ),
    "a loop without its reference": ("unrecorded_reference", "sines", lambda _: log(kind="loop")),
    "a loop in the drive": (
        "inner_loop",
        "steps",
        lambda x: replace(x, command=np.append(x.position[4:], np.full(4, x.position[-1]))),
    ),
    "two levels": ("two_levels", "steps", lambda _: log(kind="levels")),
    "too small": (
        "small_motion",
        "steps",
        lambda x: replace(x, position=x.position + noise * np.std(x.position), velocity=noise * np.std(x.velocity)),
    ),
    "too slow": (
        "weak_excitation",
        "steps",
        lambda x: replace(x, command=(x.velocity + 0.8 * np.tanh(x.velocity / 0.05)) / 10.0),
    ),
}


@pytest.fixture(scope="module")
def twins(tmp_path_factory):
    """Inspections of the clean recordings."""
    folder = tmp_path_factory.mktemp("twins")
    return {kind: inspect_bag(log(kind=kind).write(folder / kind)) for kind in ("steps", "sines")}


@pytest.mark.parametrize("item", FAULTS)
def test_a_fault_is_named_and_its_twin_has_none(tmp_path, twins, item):
    kind, twin, plant = FAULTS[item]
    assert (twins[twin].grade, twins[twin].faults) == ("usable", ())
    bad = inspect_bag(plant(log(kind=twin)).write(tmp_path / "bad"))
    named = [one for one in bad.faults if one.kind == kind]
    assert named, [one.kind for one in bad.faults]
    assert bad.grade != "usable"
    assert "\n" not in bad.grade_reason
    for one in named:
        assert one.evidence or kind == "two_clocks"
        assert one.cure
        assert one.to_dict()["cure"] == one.cure


def test_records_that_do_not_belong_together(tmp_path):
    first, loaded = log().write(tmp_path / "first"), log(gain=20.0).write(tmp_path / "loaded")
    second = log(kind="sines").write(tmp_path / "second")
    found = [inspect_bag(one) for one in (first, second, loaded)]
    assert compare_inspections(found[:2]) == []
    (other,) = compare_inspections(found)
    assert (other.kind, other.where) == ("other_gain", "loaded")
    assert other.cure
