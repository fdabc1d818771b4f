"""How often the checks of a recording find a fault that is there, and how often one that is not.

Simulates axes (DC motor, axis with Coulomb friction, lead screw, torsion rig; with friction, cogging, backlash
and compliance; open loop and PD control; 100 Hz to 2 kHz; noise and quantisation), records them cleanly and with each
fault, and inspects recordings of public sets below the folder IDLOOP_DATA. Prints a row for each check.

    .venv/bin/python benchmarks/inspection.py [--runs 40] [--jobs 1] [--measured]
"""

from __future__ import annotations

import argparse
import os
import tempfile
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from multiprocessing import Pool
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from numpy.typing import NDArray

from idloop.errors import IdloopError
from idloop.physics import load_model
from idloop.physics.plant import Plant
from idloop.records import inspect_bag, make_stream
from idloop.records.bags.publishers import find_publishers
from idloop.records.inspection.axis import Axis
from idloop.records.inspection.faults.checks import inspect_axis
from idloop.records.inspection.together import between_records
from idloop.records.tables.importing import import_bag
from idloop.signals import build_signal

Floats = NDArray[np.float64]
Random = np.random.Generator
Plant_ = Callable[[Random, "Recorded"], "Recorded"]


@dataclass(frozen=True)
class Machine:
    """A machine to simulate: preset, body whose motion is measured, size of the command, and what else acts on it.

    `inertia`, `gain` and `viscous` are those of all bodies together, for the controller; `lag` is the time [s] in which
    the speed settles.
    """

    model: str
    body: int
    command: float
    inertia: float
    gain: float
    viscous: float
    effects: tuple[str, ...] = ()
    driven: float = 1.0

    @property
    def lag(self) -> float:
        """Time constant of the speed [s]."""
        return self.inertia / self.viscous


MACHINES = (
    Machine("dc_motor", 0, 3.0, 1.0, 8.255, 2.306),
    Machine("dc_motor", 0, 3.0, 1.0, 8.255, 2.306, ("coulomb_friction@motor(level=3.0)", "dead_zone@input(width=0.2)")),
    Machine("axis", 0, 0.5, 0.01, 1.0, 0.05, ("coulomb_friction@axis(level=0.08)",)),
    Machine(
        "axis",
        0,
        0.5,
        0.01,
        1.0,
        0.05,
        ("cogging@axis(amplitude=0.04, harmonic=7)", "stribeck_friction@axis(coulomb=0.05, static=0.08, velocity=0.3)"),
    ),
    Machine("axis", 0, 0.5, 0.01, 1.0, 0.05, ("gravity@axis(moment=0.1)", "coulomb_friction@axis(level=0.04)")),
    Machine("lead_screw", 0, 6.0, 2.45e-4, 0.05, 2.65e-3, ("coulomb_friction@stage(level=0.03)",)),
    Machine("torsion", 0, 0.3, 1.67e-3, 0.0742, 3.5e-3, driven=0.0186),
    Machine(
        "torsion",
        0,
        0.3,
        1.67e-3,
        0.0742,
        3.5e-3,
        ("backlash@motor-load1(gap=0.02)", "coulomb_friction@motor(level=0.002)"),
        0.0186,
    ),
)


@dataclass(frozen=True)
class Recorded:
    """A recording of one joint as the checks get it, and what made it."""

    axis: Axis
    rate: float
    closed: bool
    machine: Machine
    true_velocity: Floats


def record(
    seed: int,
    *,
    machine: Machine | None = None,
    closed: bool | None = None,
    clip: float | None = None,
    limit: float | None = None,
    slew: float | None = None,
    speed_limit: float | None = None,
    rates: tuple[float, ...] = (100.0, 200.0, 500.0, 1000.0, 2000.0),
    lags: float = 12.0,
    levels: str | None = None,
    scale: float = 1.0,
    push: float = 0.0,
) -> Recorded:
    """Simulate one recording: clean, or with a command that is clipped, or that the drive limits.

    `clip`, `limit` and `push` are shares of the command, `slew` is commands per time constant, `speed_limit` a share of
    the steady speed. A push acts once, for a fifth to the whole of the time constant.
    """
    random = np.random.default_rng(seed)
    machine = machine or MACHINES[int(random.integers(len(MACHINES)))]
    rate = float(random.choice(rates))
    duration = max(2500.0 / rate, lags * machine.lag)
    duration *= min(1.0, 12_000.0 / (duration * rate))
    closed = bool(random.uniform() < 0.4) if closed is None else closed
    kinds_of = ["multilevel", "multisine", "chirp", "smooth", "one way"]
    kinds_of = kinds_of[:-1] if levels == "any" else kinds_of
    kind = levels if levels not in (None, "any") else str(random.choice(kinds_of))
    amplitude = machine.command * scale
    signal = excitation(random, kind, rate, duration, amplitude, machine.lag)
    plant = Plant(load_model(machine.model).with_effects(list(machine.effects)), seed, noise=False)
    count = signal.size
    bandwidth = min(2.0 * np.pi * float(random.uniform(1.5, 4.0)), 0.1 * rate, 0.2 * machine.driven * rate)
    stiffness = bandwidth**2 * machine.inertia / machine.gain
    damping = max(1.4 * bandwidth * machine.inertia - machine.viscous, 0.0) / machine.gain
    reference = signal / max(float(np.max(np.abs(signal))), 1e-12) * amplitude / stiffness * 2.0
    steps = 10.0 ** random.uniform(3.0, 5.0)
    noise = 10.0 ** random.uniform(-5.0, -3.5)
    span = (
        2.0 * float(np.max(np.abs(reference))) if closed else machine.gain * amplitude / machine.viscous * machine.lag
    )
    quantised = bool(random.uniform() < 0.5)
    position, velocity, command = np.empty(count), np.empty(count), np.empty(count)
    true_velocity = np.empty(count)
    top = machine.gain * amplitude / machine.viscous
    speed_noise = top * 10.0 ** random.uniform(-3.0, -1.7)
    with_velocity, smooth, last = bool(random.uniform() < 0.6), 0.0, 0.0
    before = 0.0
    outside = np.random.default_rng(seed + 5)
    begin, long = outside.uniform(0.2, 0.8) * duration, outside.uniform(0.2, 1.0) * machine.lag
    push *= amplitude * float(outside.choice([-1.0, 1.0]))
    for k in range(count):
        p, v = float(plant.position[machine.body]), float(plant.velocity[machine.body])
        true_velocity[k] = v
        position[k] = span / steps * np.round(p * steps / span) if quantised else p + noise * span * random.normal()
        velocity[k] = v + speed_noise * random.normal()
        # Without a tachometer the controller takes the filtered difference of the position.
        smooth += 0.2 * ((position[k] - last) * rate - smooth) if k else 0.0
        last = position[k]
        speed = velocity[k] if with_velocity else smooth
        command[k] = stiffness * (reference[k] - position[k]) - damping * speed if closed else signal[k]
        if clip is not None:
            command[k] = float(np.clip(command[k], -clip * amplitude, clip * amplitude))
        applied = command[k] if limit is None else np.clip(command[k], -limit * amplitude, limit * amplitude)
        if slew is not None:
            step = slew * amplitude / (rate * machine.lag)
            applied = before = float(np.clip(applied, before - step, before + step))
        if speed_limit is not None:
            most = speed_limit * top
            stiff = 0.3 * machine.inertia * machine.driven * rate
            caps = [(machine.viscous * most + stiff * (most - one)) / machine.gain for one in (v, -v)]
            applied = float(np.clip(applied, -caps[1], caps[0]))
        applied = applied + (push if begin <= k / rate < begin + long else 0.0)
        plant.step(float(applied), (k + 1) / rate)
    time = np.arange(count) / rate
    axis = Axis(
        "j",
        time,
        position,
        velocity if with_velocity else None,
        time.copy(),
        command,
        "j.effort",
        {"j.position": "rad", "j.velocity": "rad/s", "j.effort": "V"},
        has_reference=closed,
    )
    return Recorded(axis, rate, closed, machine, true_velocity)


def excitation(random: Random, kind: str, rate: float, duration: float, amplitude: float, lag: float) -> Floats:
    """A command, or a reference, for an axis of that time constant [s]."""
    seed, common = (
        int(random.integers(1 << 30)),
        {"sample_time": 1.0 / rate, "duration": duration, "amplitude": amplitude},
    )
    if kind == "multilevel":
        signal = build_signal("multilevel", seed=seed, hold_min=0.2 * lag, hold_max=2.0 * lag, **common)
    elif kind == "multisine":
        signal = build_signal(
            "multisine",
            seed=seed,
            period=0.5 * duration,
            frequency_min=0.05 / lag,
            frequency_max=min(1.5 / lag, 0.1 * rate),
            **common,
        )
    elif kind == "chirp":
        signal = build_signal(
            "chirp", frequency_start=0.05 / lag, frequency_end=min(2.0 / lag, 0.1 * rate), sweep_time=duration, **common
        )
    elif kind == "one way":
        # With gravity, springs or cogging the axis goes back where the command is small.
        levels = build_signal("multilevel", seed=seed, hold_min=0.2 * lag, hold_max=2.0 * lag, **common)
        return np.asarray(0.5 * amplitude + 0.5 * levels.value)
    elif kind == "two levels":
        signal = build_signal("prbs", seed=seed, band_hz=1.0 / lag, **common)
        return np.asarray(np.where(signal.value >= 0.0, amplitude, -amplitude))
    elif kind == "slow":
        # The inertia makes about a hundredth of the force.
        return _sines(random, rate, duration, amplitude, (0.003 / lag, 0.015 / lag))
    else:
        return _sines(random, rate, duration, amplitude, (0.3 / lag, 1.2 / lag))
    return np.asarray(signal.value)


def _sines(random: Random, rate: float, duration: float, amplitude: float, turns: tuple[float, float]) -> Floats:
    """Three sines [rad/s]."""
    time = np.arange(round(duration * rate)) / rate
    sines = [np.sin(turn * time + k) for k, turn in enumerate(random.uniform(*turns, size=3))]
    return np.asarray(amplitude / 3.0 * np.sum(sines, axis=0))


def _with(recorded: Recorded, **changes: object) -> Recorded:
    return replace(recorded, axis=replace(recorded.axis, **changes))


def _velocity(random: Random, recorded: Recorded) -> Floats:
    """The velocity on record, or where there is none the true one with 1 % noise."""
    if recorded.axis.velocity is not None:
        return recorded.axis.velocity
    true = recorded.true_velocity
    return np.asarray(true + 0.01 * np.std(true) * random.normal(size=true.size))


def rpm(random: Random, recorded: Recorded) -> Recorded:
    """A velocity in rpm, read as rad/s."""
    return _with(recorded, velocity=30.0 / np.pi * _velocity(random, recorded))


def turned_velocity(random: Random, recorded: Recorded) -> Recorded:
    """The sign of the velocity turned."""
    return _with(recorded, velocity=-_velocity(random, recorded))


def dead_velocity(random: Random, recorded: Recorded) -> Recorded:
    """A column of zeros."""
    return _with(recorded, velocity=np.zeros(recorded.axis.time.size))


def gear(random: Random, recorded: Recorded) -> Recorded:
    """The velocity of the other side of a gear."""
    return _with(recorded, velocity=float(random.choice([3.0, 5.0, 30.0, 100.0])) * _velocity(random, recorded))


def scaled(random: Random, recorded: Recorded) -> Recorded:
    """A velocity that is a tenth too large or too small."""
    return _with(recorded, velocity=float(random.choice([0.9, 1.1])) * _velocity(random, recorded))


def clipped(random: Random, recorded: Recorded) -> Recorded:
    """A velocity that is cut off at 30 to 80 % of its range."""
    velocity = _velocity(random, recorded)
    limit = random.uniform(0.3, 0.8) * float(np.max(np.abs(velocity)))
    return _with(recorded, velocity=np.clip(velocity, -limit, limit))


def filtered_velocity(random: Random, recorded: Recorded) -> Recorded:
    """A first-order low pass whose delay is a tenth of the time constant, at least three samples."""
    from scipy.signal import lfilter

    late = max(0.1 * recorded.machine.lag, 3.0 / recorded.rate)
    decay = float(np.exp(-1.0 / (recorded.rate * late)))
    return _with(recorded, velocity=np.asarray(lfilter([1.0 - decay], [1.0, -decay], _velocity(random, recorded))))


def sign_lost(random: Random, recorded: Recorded) -> Recorded:
    """The size of the command without its sign."""
    return _with(recorded, command=np.abs(recorded.axis.command))


def turned_command(random: Random, recorded: Recorded) -> Recorded:
    """The sign of the command turned."""
    return _with(recorded, command=-recorded.axis.command)


def two_clocks(random: Random, recorded: Recorded) -> Recorded:
    """Simulated time against the clock of the recorder."""
    axis = recorded.axis
    receive = (1.7e18 + 1e9 * axis.time).astype(np.int64)
    simulated = (12e9 + 1e9 * axis.time).astype(np.int64)
    columns = {"j": {"position": axis.position}}
    return _with(
        recorded,
        measured_stream=make_stream("joint_states", simulated, columns, receive),
        command_stream=make_stream("joint_command", receive, {"j": {"effort": axis.command}}, receive),
    )


def receive_times(random: Random, recorded: Recorded) -> Recorded:
    """Delays of the network of a fifth of a period on average."""
    axis = recorded.axis
    late = np.minimum(random.exponential(0.2, size=axis.time.size), 0.95) / recorded.rate
    return _with(recorded, time=axis.time + late)


def repeated(random: Random, recorded: Recorded) -> Recorded:
    """One of twenty values is sent again."""
    return _with(recorded, **_held(recorded, random.uniform(size=recorded.axis.time.size) < 0.05))


def fast_log(random: Random, recorded: Recorded) -> Recorded:
    """The log is three times as fast as the sensor."""
    return _with(recorded, **_held(recorded, np.arange(recorded.axis.time.size) % 3 != 0))


def _held(recorded: Recorded, old: NDArray[np.bool_]) -> dict[str, Floats]:
    fresh = np.maximum.accumulate(np.where(old, 0, np.arange(old.size)))
    axis = recorded.axis
    return {
        name: value[fresh]
        for name, value in (("position", axis.position), ("velocity", axis.velocity))
        if value is not None
    }


def pulses(random: Random, recorded: Recorded) -> Recorded:
    """Ten times pulses are missed or counted twice, 1 % of the range each."""
    axis = recorded.axis
    step = np.gradient(axis.position)
    fast = np.flatnonzero(np.abs(step) > 0.3 * np.max(np.abs(step)))
    rows = random.choice(fast, 10, replace=False)
    shift = np.zeros(step.size)
    shift[rows] = 0.01 * np.ptp(axis.position) * random.choice([1.0, -1.0], size=10)
    return _with(recorded, position=axis.position + np.cumsum(shift))


def spliced(random: Random, recorded: Recorded) -> Recorded:
    """The second half of the record comes from elsewhere: a fifth of the range away."""
    position = recorded.axis.position.copy()
    position[position.size // 2 :] += 0.2 * np.ptp(position) * random.choice([1.0, -1.0])
    return _with(recorded, position=position)


def _stuck(random: Random, value: Floats) -> Floats:
    """The value stays what it was for a tenth of the record."""
    held, first = value.copy(), int(random.integers(0, value.size - value.size // 10))
    held[first : first + value.size // 10] = value[first]
    return held


def stuck_position(random: Random, recorded: Recorded) -> Recorded:
    """The position stands still, the velocity goes on."""
    velocity = _velocity(random, recorded)
    return _with(recorded, position=_stuck(random, recorded.axis.position), velocity=velocity)


def stuck_alone(random: Random, recorded: Recorded) -> Recorded:
    """The position stands still, and no velocity is recorded."""
    return replace(recorded, axis=replace(stuck_position(random, recorded).axis, velocity=None))


def stuck_velocity(random: Random, recorded: Recorded) -> Recorded:
    """The velocity stands still, the position goes on."""
    return _with(recorded, velocity=_stuck(random, _velocity(random, recorded)))


def late_command(random: Random, recorded: Recorded) -> Recorded:
    """The command is recorded five to twenty samples late: the motion comes before it."""
    command = recorded.axis.command
    late = int(random.integers(5, 21))
    return _with(recorded, command=np.concatenate([np.full(late, command[0]), command[:-late]]))


def spikes(random: Random, recorded: Recorded) -> Recorded:
    """Five positions off by 5 % of the range."""
    position = recorded.axis.position.copy()
    rows = random.integers(10, position.size - 10, size=5)
    position[rows] += 0.05 * np.ptp(position) * random.choice([1.0, -1.0], size=5)
    return _with(recorded, position=position)


def overflow(random: Random, recorded: Recorded) -> Recorded:
    """One reading of a position, or of the command, is 65535."""
    field = str(random.choice(["position", "command"]))
    value = getattr(recorded.axis, field).copy()
    value[random.integers(value.size)] = 65535.0
    return replace(recorded, axis=_with(recorded, **{field: value}).axis.without_bad_readings())


def coarse(random: Random, recorded: Recorded) -> Recorded:
    """Forty steps over the range."""
    position = recorded.axis.position
    step = np.ptp(position) / 40.0
    return _with(recorded, position=step * np.round(position / step))


def inner_position(random: Random, recorded: Recorded) -> Recorded:
    """The command is a set-point that the position follows."""
    return _set_point(recorded, recorded.axis.position, "position")


def inner_velocity(random: Random, recorded: Recorded) -> Recorded:
    """The command is a set-point of the velocity, without a unit."""
    return _set_point(recorded, recorded.true_velocity, "velocity")


def _set_point(recorded: Recorded, motion: Floats, field: str) -> Recorded:
    early = np.concatenate([motion[3:], np.full(3, motion[-1])])
    units = {"j.position": "rad", "j.velocity": "rad/s"}
    return _with(recorded, command=early, units=units, command_name="j.effort", has_reference=True)


def copied_velocity(random: Random, recorded: Recorded) -> Recorded:
    """The column of the command is that of the velocity in another unit, at once or a sample late."""
    velocity = _velocity(random, recorded)
    late = int(random.integers(0, 2))
    return _with(recorded, command=0.3 * np.concatenate([velocity[:late], velocity[: velocity.size - late]]))


def other_machine(random: Random, recorded: Recorded) -> Recorded:
    """From the middle on the same command accelerates twice as much."""
    command = recorded.axis.command.copy()
    command[command.size // 2 :] *= 0.5
    return _with(recorded, command=command)


def clipped_reading(random: Random, recorded: Recorded) -> Recorded:
    """The command is measured by a sensor that cuts it off at 60 %."""
    limit = 0.6 * float(np.max(np.abs(recorded.axis.command)))
    return _with(recorded, command=np.clip(recorded.axis.command, -limit, limit))


def no_reference(random: Random, recorded: Recorded) -> Recorded:
    """A closed loop without its reference on record."""
    return _with(recorded, has_reference=False)


def wrapped(random: Random, recorded: Recorded) -> Recorded:
    """A range of a third of the motion."""
    position = recorded.axis.position
    span = np.ptp(position) / 3.0
    return _with(recorded, position=np.mod(position, span))


def measured(random: Random, recorded: Recorded) -> Recorded:
    """The mean of the held command around each stamp, as a filter before the converter of a current gives."""
    axis = recorded.axis
    mean = 0.5 * (axis.command + np.concatenate([axis.command[:1], axis.command[:-1]]))
    return _with(recorded, command=mean)


def two_publishers(random: Random, recorded: Recorded) -> Recorded:
    """A second node sends zeros, at a fifth of the rate and from another phase."""
    axis = recorded.axis
    every = axis.time[::5] + 0.4 / recorded.rate
    time = np.concatenate([axis.time, every])
    order = np.argsort(time, kind="stable")
    position = np.concatenate([axis.position, np.full(every.size, axis.position.max() + np.ptp(axis.position))])
    stamps = (1e9 + 1e9 * time[order]).astype(np.int64)
    both = find_publishers(make_stream("joint_states", stamps, {"j": {"position": position[order]}}))
    return _with(recorded, publishers=() if both is None else (both,))


def same(random: Random, recorded: Recorded) -> Recorded:
    """Nothing: the fault is in the way the record is made."""
    return recorded


@dataclass(frozen=True)
class Case:
    """A planted fault: kinds of findings that name it, how it is planted, and how the record is made."""

    title: str
    kinds: tuple[str, ...]
    plant: Plant_
    options: dict[str, object]


CASES = (
    Case("velocity in rpm", ("wrong_velocity",), rpm, {}),
    Case("velocity with its sign turned", ("wrong_velocity",), turned_velocity, {}),
    Case("velocity constant", ("wrong_velocity",), dead_velocity, {}),
    Case("velocity of the other side of a gear", ("wrong_velocity",), gear, {}),
    Case("velocity 10 % too large or too small", ("wrong_velocity",), scaled, {}),
    Case("velocity cut off at 30 to 80 %", ("wrong_velocity",), clipped, {}),
    Case("velocity behind a filter, 0.1 time constants", ("late_velocity",), filtered_velocity, {}),
    Case("command without its sign", ("sign_lost",), sign_lost, {"levels": "any"}),
    Case("command turned against the motion", ("turned_command",), turned_command, {}),
    Case("command recorded 5 to 20 samples late", ("late_command",), late_command, {}),
    Case("simulated time against receive time", ("two_clocks",), two_clocks, {}),
    Case("receive times as stamps, 0.2 periods", ("wrong_stamps",), receive_times, {}),
    Case("5 % of the samples repeated", ("repeated_samples",), repeated, {}),
    Case("log three times as fast as the sensor", ("repeated_samples",), fast_log, {}),
    Case("position wraps", ("wrapped_position",), wrapped, {}),
    Case("position stands still for a tenth of the record", ("stuck_sensor",), stuck_position, {}),
    Case("position stands still, no velocity", ("stuck_sensor",), stuck_alone, {}),
    Case("velocity stands still for a tenth of the record", ("stuck_sensor",), stuck_velocity, {}),
    Case("10 times encoder pulses of 1 % missed", ("missed_pulses",), pulses, {}),
    Case("two records joined, a fifth of a range apart", ("spliced",), spliced, {}),
    Case("5 single bad readings of 5 %", ("spikes",), spikes, {}),
    Case("one reading of 65535", ("spikes",), overflow, {}),
    Case("40 steps over the range", ("coarse",), coarse, {}),
    Case("command cut off at 60 %", ("saturated_command",), same, {"levels": "smooth", "closed": False, "clip": 0.6}),
    Case("reading of the command cut off at 60 %", ("clipped_reading",), clipped_reading, {"closed": False}),
    Case("command is a set-point of the position", ("inner_loop",), inner_position, {}),
    Case("command is a set-point of the velocity", ("inner_loop",), inner_velocity, {}),
    Case("command is a copy of the velocity", ("copied_motion",), copied_velocity, {}),
    Case("loop closed, no reference", ("unrecorded_reference",), no_reference, {"closed": True}),
    Case(
        "command measured, not held",
        ("measured_input",),
        measured,
        {"levels": "multilevel", "closed": False, "rates": (50.0, 100.0)},
    ),
    Case("drive limits the command to 40 %", ("not_followed",), same, {"closed": False, "limit": 0.4}),
    Case(
        "drive limits the rate of the command",
        ("not_followed",),
        same,
        {"closed": False, "levels": "multilevel", "slew": 3.0},
    ),
    Case(
        "drive limits the speed to 30 %",
        ("not_followed",),
        same,
        {"closed": False, "levels": "multilevel", "speed_limit": 0.3},
    ),
    Case(
        "motion too slow for the inertia",
        ("weak_excitation",),
        same,
        {"levels": "slow", "closed": False, "rates": (20.0,), "lags": 1200.0},
    ),
    Case("one push of half the command", ("outside_force",), same, {"push": 0.5}),
    Case("twice the gain from the middle on", ("changed_machine",), other_machine, {}),
    Case("two publishers on one topic", ("two_publishers",), two_publishers, {}),
    Case("two levels only", ("two_levels",), same, {"levels": "two levels", "closed": False}),
)


def kinds(recorded: Recorded) -> set[str]:
    """Kinds of the warnings on one recording."""
    return {one.kind for one in inspect_axis(recorded.axis) if one.level == "warning"}


def clean(seed: int) -> set[str]:
    """Warnings on a clean recording."""
    return kinds(record(seed))


def planted(job: tuple[int, int]) -> bool:
    """Whether the fault of a case is named."""
    number, seed = job
    case = CASES[number]
    recorded = record(10_000 + seed, **case.options)  # type: ignore[arg-type]
    return bool(kinds(case.plant(np.random.default_rng(seed), recorded)) & set(case.kinds))


def pair(job: tuple[float, int]) -> bool:
    """Whether two records of one machine, the gain of the second so many times that of the first, are told apart."""
    ratio, seed = job
    machine = MACHINES[seed % len(MACHINES)]
    records = [record(30_000 + 2 * seed + k, machine=machine) for k in range(2)]
    records[1] = _with(records[1], command=records[1].axis.command / ratio)
    found = between_records({str(k): [one.axis] for k, one in enumerate(records)})
    return any(one.kind == "other_gain" for one in found)


@dataclass(frozen=True)
class MeasuredSet:
    """A public data set: files, mapping, parts, and the faults that its description or its data show to be there."""

    folder: str
    files: str
    mapping: str
    true: tuple[str, ...]
    parts: tuple[str | None, ...] = (None,)


# In this order: a position servo with a pulse width that saturates and does not act while its torque is released, a
# filtered and coarse speed, some runs slow; an unsigned speed under two levels; the speed counter of a motor that
# glitches, and slow ramps; an input that was sampled; torque steps; slow turns, and runs at constant speed, under a
# reference that is not recorded.
MEASURED = (
    MeasuredSet(
        "bam_servo_pendulum/xl330_raw",
        "*.json",
        "bam",
        ("late_velocity", "coarse", "weak_excitation", "saturated_command", "lost_samples", "not_followed"),
    ),
    MeasuredSet("ced_prbs", "drive.mat", "ced", ("two_levels", "weak_excitation"), ("z1", "z2", "z3")),
    MeasuredSet("dcmotor_fra233/npz", "*Step.npz", "dcmotor_fra233", ("two_levels", "spikes")),
    MeasuredSet("dcmotor_fra233/npz", "*Ramp.npz", "dcmotor_fra233", ("weak_excitation", "spikes")),
    MeasuredSet("dcmotor_fra233/npz", "*S[it][na]*.npz", "dcmotor_fra233", ("spikes",)),
    MeasuredSet("dcmotor_fra233/npz", "*Chirp.npz", "dcmotor_fra233", ("spikes",)),
    MeasuredSet("emps", "*.mat", "emps", ()),
    MeasuredSet("silverbox", "*.csv", "silverbox", ("measured_input",), ("arrow", "multisine_1", "multisine_2")),
    MeasuredSet("hsm150", "*.csv", "map.yaml", ("two_levels",)),
    MeasuredSet("kuka_joint", "*.csv", "map.yaml", ()),
    MeasuredSet("odrive_cogging", "*.csv", "map.yaml", ("unrecorded_reference", "weak_excitation", "lost_samples")),
    MeasuredSet("screw_drives/drive1", "*.csv", "../map.yaml", ("unrecorded_reference", "weak_excitation", "coarse")),
    MeasuredSet("screw_drives/drive2", "*.csv", "../map.yaml", ("unrecorded_reference", "weak_excitation", "coarse")),
)


def measured_sets(folder: Path) -> tuple[int, Counter[str], Counter[str]]:
    """Recordings inspected, and how many have each warning, of those that are there and of others."""
    count, there, false = 0, Counter[str](), Counter[str]()
    with tempfile.TemporaryDirectory() as work:
        for one in MEASURED:
            for file in sorted((folder / one.folder).glob(one.files)):
                mapping = file.parent / one.mapping if one.mapping.endswith(".yaml") else one.mapping
                for part in one.parts:
                    bag = Path(work) / f"{count}"
                    try:
                        import_bag(file, bag, mapping, part=part)
                        inspection = inspect_bag(bag)
                    except IdloopError as error:
                        print(f"left out: {error}")
                        continue
                    count += 1
                    found = {fault.kind for fault in inspection.faults} if inspection.verdict == "usable" else set()
                    there.update(found & set(one.true))
                    false.update(found - set(one.true))
                    for kind in sorted(found - set(one.true)):
                        print(f"not in the description of {one.folder}: {kind} in {file.name} {part or ''}")
    return count, there, false


def main() -> None:
    """Print the counts."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=40, help="recordings of each fault; five times as many clean ones")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    arguments = parser.parse_args()
    runs, many = arguments.runs, 5 * arguments.runs
    with Pool(arguments.jobs) as pool:
        alarms = Counter(kind for found in pool.imap(clean, range(many), chunksize=8) for kind in found)
        jobs = [(number, seed) for number in range(len(CASES)) for seed in range(runs)]
        hits = Counter(
            number for (number, _), hit in zip(jobs, pool.imap(planted, jobs, chunksize=8), strict=True) if hit
        )
        gains = [sum(pool.imap(pair, [(ratio, seed) for seed in range(runs)], chunksize=8)) for ratio in (2.0, 1.0)]
    count, there, false = measured_sets(Path(os.environ.get("IDLOOP_DATA", "../shared/data")))
    rows = [
        (case.title, case.kinds[0], f"{hits[n]}/{runs}", f"{alarms[case.kinds[0]]}/{many}")
        for n, case in enumerate(CASES)
    ]
    rows.append(("second record with twice the gain", "other_gain", f"{gains[0]}/{runs}", f"{gains[1]}/{runs}"))
    named = {row[1] for row in rows}
    rows += [
        ("", kind, "", f"{alarms[kind]}/{many}") for kind in sorted((set(alarms) | set(there) | set(false)) - named)
    ]
    print(f"{'fault planted':46s}{'check':22s}{'hits':>8s}{'false, clean':>14s}{'measured: true':>16s}{'false':>8s}")
    for title, kind, hit, alarm in rows:
        measured_ones = f"{f'{there[kind]}/{count}':>16s}{f'{false[kind]}/{count}':>8s}"
        print(f"{title:46s}{kind:22s}{hit:>8s}{alarm:>14s}{measured_ones}")


if __name__ == "__main__":
    main()
