"""A simulator written from the catalogue's equations alone; it shares no code with idloop.

Fixed small steps. Smooth forces by Heun's method; dry friction by an implicit impulse (Moreau):
friction takes away at most the velocity that is there, so a body sticks exactly and no event
is searched. First order at a reversal, second order elsewhere: the step is a small part of a sample.

Where several effects act on the command they stand in the order delay, saturation, asymmetry of
the gain, offset, dead zone, lag, supply limit; at a sensor: play, filter, delay, ripple, offset,
noise, quantisation.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray
from plain import Plain, PlainEffect

Array = NDArray[np.float64]

# Columns of the tables. Input: one row of numbers.
DELAY, LIMIT, ASYMMETRY, OFFSET, DEAD_UP, DEAD_DOWN, LAG, SUPPLY, BACK_EMF, RESISTANCE, GAIN = range(11)
# Bodies.
INERTIA, VISCOUS, LEVEL_UP, LEVEL_DOWN, S_LOW, S_HIGH, S_SPEED, RATIO, P_LEVEL, P_STIFF, P_STATIC, P_SPEED = range(12)
P_DAMP, DRAG, ONE_WAY, CABLE, REST, TORQUE, WAVE = range(12, 19)
WAVES = 4  # amplitude, harmonic, phase of up to so many forces over the turn
# Couplings.
STIFFNESS, DAMPING, GAP, CUBIC, SLIP = range(5)
# Sensors.
BODY, IS_VELOCITY, SCALE, PLAY, FILTER, LATE, RIPPLE, HARMONIC, PHASE, SHIFT, STEP = range(11)


@njit(cache=True)
def _drive(machine: Array, command: float, lagged: float, speed: float) -> float:
    """Force of the drive; ``lagged`` is the output of the first-order lag."""
    value = lagged if machine[LAG] > 0.0 else command
    if machine[SUPPLY] < np.inf:
        high = (machine[SUPPLY] - machine[BACK_EMF] * speed) / machine[RESISTANCE]
        low = (-machine[SUPPLY] - machine[BACK_EMF] * speed) / machine[RESISTANCE]
        value = min(max(value, low), high)
    return machine[GAIN] * value


@njit(cache=True)
def _before_lag(machine: Array, command: float) -> float:
    """Saturation, asymmetry, offset and dead zone."""
    value = min(max(command, -machine[LIMIT]), machine[LIMIT])
    value = value * (1.0 + machine[ASYMMETRY] * np.sign(value)) + machine[OFFSET]
    if value > machine[DEAD_UP]:
        return value - machine[DEAD_UP]
    if value < -machine[DEAD_DOWN]:
        return value + machine[DEAD_DOWN]
    return 0.0


@njit(cache=True)
def _carried(row: Array, twist: float, rate: float, slipped: float) -> float:
    """Torque through a coupling."""
    if row[GAP] > 0.0:
        half = 0.5 * row[GAP]
        if abs(twist) <= half:
            return 0.0
        twist -= half * np.sign(twist)
    torque = row[STIFFNESS] * (twist - slipped) + row[DAMPING] * rate + row[CUBIC] * twist**3
    return min(max(torque, -row[SLIP]), row[SLIP])


@njit(cache=True)
def _bristle_limit(row: Array, speed: float) -> float:
    """Deflection of the bristles in steady sliding."""
    ratio = speed / row[P_SPEED]
    return (row[P_LEVEL] + (row[P_STATIC] - row[P_LEVEL]) * math.exp(-ratio * ratio)) / row[P_STIFF]


@njit(cache=True)
def _bristle_after(row: Array, bristle: float, speed: float, step: float) -> float:
    """Deflection after sliding at a constant speed: dz/dt = v - abs(v) z / limit, solved exactly."""
    limit = _bristle_limit(row, speed)
    if speed == 0.0:
        return bristle
    end = limit * np.sign(speed)
    return end + (bristle - end) * math.exp(-abs(speed) * step / limit)


@njit(cache=True)
def _forces(bodies: Array, couplings: Array, x: Array, v: Array, drive: float, bristle: Array, slipped: Array,
            force: Array, arriving: Array) -> None:  # fmt: skip
    """Everything but dry friction."""
    n = bodies.shape[0]
    for i in range(n):
        row = bodies[i]
        f = -row[VISCOUS] * v[i] - row[DRAG] * abs(v[i]) * v[i] - row[ONE_WAY] * abs(v[i])
        f += row[TORQUE] - row[CABLE] * (x[i] - row[REST])
        for w in range(WAVES):
            if row[WAVE + 3 * w] != 0.0:
                f -= row[WAVE + 3 * w] * math.sin(row[WAVE + 3 * w + 1] * x[i] + row[WAVE + 3 * w + 2])
        if row[P_LEVEL] > 0.0:
            rate = v[i] - abs(v[i]) * bristle[i] / _bristle_limit(row, v[i])
            f -= row[P_STIFF] * bristle[i] + row[P_DAMP] * rate
        force[i] = f
    force[0] += drive
    for i in range(n - 1):
        torque = _carried(couplings[i], x[i] - x[i + 1], v[i] - v[i + 1], slipped[i])
        force[i] -= torque
        force[i + 1] += torque
        arriving[i + 1] = abs(torque)


@njit(cache=True)
def _after_friction(row: Array, free: float, speed: float, arriving: float, step: float) -> float:
    """Velocity after dry friction has acted for a step; it can stop a body but not turn it round."""
    level = row[LEVEL_UP] if free > 0.0 else row[LEVEL_DOWN]
    if row[S_HIGH] > 0.0 or row[S_LOW] > 0.0:
        ratio = speed / row[S_SPEED]
        level += row[S_LOW] + (row[S_HIGH] - row[S_LOW]) * math.exp(-ratio * ratio)
    taken = (level + row[RATIO] * arriving) * step / row[INERTIA]
    if taken >= abs(free):
        return 0.0
    return free - taken * np.sign(free)


@njit(cache=True)
def _sense(sensors: Array, x: Array, v: Array, step: float, memory: Array, ring: Array, at: int) -> None:
    """Bring plays and filters to the present motion and keep it for late sensors."""
    for j in range(sensors.shape[0]):
        row = sensors[j]
        body = int(row[BODY])
        value = row[SCALE] * (v[body] if row[IS_VELOCITY] else x[body])
        if row[PLAY] > 0.0:
            half = 0.5 * row[PLAY]
            memory[j, 0] = min(max(memory[j, 0], value - half), value + half)
            value = memory[j, 0]
        if row[FILTER] > 0.0:
            # the mean of the old and new input over the step
            decay = math.exp(-step / row[FILTER])
            mean = 0.5 * (memory[j, 2] + value)
            memory[j, 1] = mean + (memory[j, 1] - mean) * decay
            memory[j, 2] = value
            value = memory[j, 1]
        place = at % ring.shape[0]
        ring[place, j, 0] = value
        ring[place, j, 1] = x[body]


@njit(cache=True)
def _read(sensors: Array, ring: Array, at: int, noise: Array, reading: Array) -> None:
    """What the sensors show now."""
    size = ring.shape[0]
    for j in range(sensors.shape[0]):
        row = sensors[j]
        late = min(row[LATE], float(at))
        whole = math.floor(late)
        part = late - whole
        new, old = (at - whole) % size, max(at - whole - 1, 0) % size
        value = (1.0 - part) * ring[new, j, 0] + part * ring[old, j, 0]
        angle = (1.0 - part) * ring[new, j, 1] + part * ring[old, j, 1]
        value *= 1.0 + row[RIPPLE] * math.sin(row[HARMONIC] * angle + row[PHASE])
        value += row[SHIFT] + noise[j]
        if row[STEP] > 0.0:
            value = row[STEP] * math.floor(value / row[STEP] + 0.5)
        reading[j] = value


@njit(cache=True)
def _advance(machine: Array, bodies: Array, couplings: Array, sensors: Array, commands: Array, sample: int,
             disturbance: float, step: float, substeps: int, x: Array, v: Array, bristle: Array, slipped: Array,
             lagged: Array, memory: Array, ring: Array, work: Array) -> None:  # fmt: skip
    """Run through one sample of held command."""
    n = bodies.shape[0]
    force, arriving, x_next, v_next, first, bristle_next = work[0], work[1], work[2], work[3], work[4], work[5]
    for sub in range(substeps):
        at = sample * substeps + sub
        late = at + 0.5 - machine[DELAY]
        command = commands[int(late // substeps)] if late >= 0.0 else 0.0
        command = _before_lag(machine, command)
        before, after = lagged[0], command
        if machine[LAG] > 0.0:
            after = command + (before - command) * math.exp(-step / machine[LAG])
        drive = _drive(machine, command, before, v[0])
        _forces(bodies, couplings, x, v, drive + disturbance, bristle, slipped, force, arriving)
        arriving[0] = abs(drive)
        for i in range(n):
            first[i] = force[i]
            free = v[i] + step * force[i] / bodies[i, INERTIA]
            v_next[i] = _after_friction(bodies[i], free, abs(v[i]), arriving[i], step)
            x_next[i] = x[i] + 0.5 * step * (v[i] + v_next[i])
            bristle_next[i] = bristle[i]
            if bodies[i, P_LEVEL] > 0.0:
                bristle_next[i] = _bristle_after(bodies[i], bristle[i], 0.5 * (v[i] + v_next[i]), step)
        drive = _drive(machine, command, after, v_next[0])
        _forces(bodies, couplings, x_next, v_next, drive + disturbance, bristle_next, slipped, force, arriving)
        arriving[0] = abs(drive)
        for i in range(n):
            free = v[i] + 0.5 * step * (first[i] + force[i]) / bodies[i, INERTIA]
            speed = 0.5 * (abs(v[i]) + abs(v_next[i]))
            new = _after_friction(bodies[i], free, speed, arriving[i], step)
            mean = 0.5 * (v[i] + new)
            x[i] += step * mean
            if bodies[i, P_LEVEL] > 0.0:
                bristle[i] = _bristle_after(bodies[i], bristle[i], mean, step)
            v[i] = new
        lagged[0] = after
        for i in range(n - 1):
            row = couplings[i]
            if row[SLIP] < np.inf:
                excess = row[STIFFNESS] * (x[i] - x[i + 1] - slipped[i]) + row[DAMPING] * (v[i] - v[i + 1])
                if abs(excess) > row[SLIP]:
                    slipped[i] += (excess - row[SLIP] * np.sign(excess)) / row[STIFFNESS]
        _sense(sensors, x, v, step, memory, ring, at + 1)


class EquationsMachine:
    """A machine that is stepped sample by sample.

    Parameters
    ----------
    plain : Plain
        The machine.
    sample_time : float
        Seconds between samples.
    samples : int
        How many there will be.
    substeps : int
        Integration steps in a sample.
    """

    def __init__(self, plain: Plain, sample_time: float, samples: int, substeps: int = 60) -> None:
        n, p = len(plain.inertia), len(plain.outputs)
        self._step, self._substeps = sample_time / substeps, substeps
        self._machine, self._bodies, self._couplings, self._sensors = _tables(plain, self._step)
        self._commands = np.zeros(samples + 1)
        self._sample = 0
        self._x, self._v = np.zeros(n), np.zeros(n)
        self._bristle, self._slipped, self._lagged = np.zeros(n), np.zeros(max(n - 1, 1)), np.zeros(1)
        self._memory = np.zeros((p, 3))
        self._ring = np.zeros((int(np.max(self._sensors[:, LATE])) + 4, p, 2))
        self._work = np.zeros((6, n))
        _sense(self._sensors, self._x, self._v, 0.0, self._memory, self._ring, 0)

    def measure(self, noise: Array) -> Array:
        """Read the sensors now."""
        reading = np.empty(len(noise))
        _read(self._sensors, self._ring, self._sample * self._substeps, noise, reading)
        return reading

    def step(self, command: float, disturbance: float) -> None:
        """Hold a command and a disturbance for one sample."""
        self._commands[self._sample] = command
        _advance(
            self._machine, self._bodies, self._couplings, self._sensors, self._commands, self._sample, disturbance,
            self._step, self._substeps, self._x, self._v, self._bristle, self._slipped, self._lagged, self._memory,
            self._ring, self._work,
        )  # fmt: skip
        self._sample += 1


def _tables(plain: Plain, step: float) -> tuple[Array, Array, Array, Array]:
    """Lay the machine out as the tables that the compiled functions read."""
    n = len(plain.inertia)
    machine = np.zeros(11)
    machine[[LIMIT, SUPPLY]] = np.inf
    machine[RESISTANCE], machine[GAIN] = 1.0, plain.gain
    bodies = np.zeros((n, WAVE + 3 * WAVES))
    bodies[:, INERTIA], bodies[:, VISCOUS] = plain.inertia, plain.viscous
    bodies[:, S_SPEED] = bodies[:, P_SPEED] = 1.0
    couplings = np.zeros((max(n - 1, 0), 5))
    couplings[:, STIFFNESS], couplings[:, DAMPING], couplings[:, SLIP] = plain.stiffness, plain.damping, np.inf
    sensors = np.zeros((len(plain.outputs), 11))
    for row, output in zip(sensors, plain.outputs, strict=True):
        row[BODY], row[IS_VELOCITY], row[SCALE] = output.body, output.velocity, output.scale
    for effect in plain.effects:
        _write(effect, machine, bodies, couplings, sensors, step)
    return machine, bodies, couplings, sensors


def _write(effect: PlainEffect, machine: Array, bodies: Array, couplings: Array, sensors: Array, step: float) -> None:
    """Enter one effect in the tables."""
    value = effect.values
    if effect.kind == "input":
        columns = {
            "input_delay": {DELAY: value.get("delay", 0.0) / step},
            "saturation": {LIMIT: value.get("limit")},
            "gain_asymmetry": {ASYMMETRY: value.get("ratio")},
            "input_offset": {OFFSET: value.get("offset")},
            "dead_zone": {DEAD_UP: value.get("width"), DEAD_DOWN: value.get("width_negative", value.get("width"))},
            "actuator_lag": {LAG: value.get("time_constant")},
            "speed_limit_voltage": {
                SUPPLY: value.get("supply"),
                BACK_EMF: value.get("back_emf"),
                RESISTANCE: value.get("resistance"),
            },
        }[effect.name]
        for column, number in columns.items():
            machine[column] = number
    elif effect.kind == "body":
        _write_body(effect.name, value, bodies[effect.index])
    elif effect.kind == "coupling":
        column, key = {
            "backlash": (GAP, "gap"),
            "hardening_stiffness": (CUBIC, "cubic"),
            "slip": (SLIP, "limit"),
        }[effect.name]
        couplings[effect.index, column] = value[key]
    else:
        columns = {
            "backlash": {PLAY: value.get("gap")},
            "velocity_filter": {FILTER: value.get("time_constant")},
            "sensor_delay": {LATE: value.get("delay", 0.0) / step},
            "sensor_ripple": {
                RIPPLE: value.get("amplitude"),
                HARMONIC: value.get("harmonic"),
                PHASE: value.get("phase"),
            },
            "sensor_offset": {SHIFT: value.get("offset")},
            "sensor_quantisation": {STEP: value.get("resolution")},
        }[effect.name]
        for column, number in columns.items():
            sensors[effect.index, column] = number


def _write_body(name: str, value: dict[str, float], row: Array) -> None:
    """Enter one effect at a body."""
    if name in ("gravity", "imbalance", "cogging"):
        free = next(w for w in range(WAVES) if row[WAVE + 3 * w] == 0.0)
        if name == "gravity":
            value = {"amplitude": value["moment"], "phase": -value["lowest"]}
        wave = [value["amplitude"], value.get("harmonic", 1.0), value["phase"]]
        row[WAVE + 3 * free : WAVE + 3 * free + 3] = wave
    elif name == "coulomb_friction":
        row[[LEVEL_UP, LEVEL_DOWN]] += value["level"]
    elif name == "asymmetric_friction":
        row[LEVEL_UP] += value["level"] * (1.0 + value["ratio"])
        row[LEVEL_DOWN] += value["level"] * (1.0 - value["ratio"])
    elif name == "stribeck_friction":
        row[[S_LOW, S_HIGH, S_SPEED]] = value["coulomb"], value["static"], value["velocity"]
    elif name == "presliding_friction":
        row[[P_LEVEL, P_STIFF, P_STATIC]] = value["level"], value["stiffness"], value.get("static", value["level"])
        row[[P_SPEED, P_DAMP]] = value["velocity"], value["damping"]
    else:
        columns = {
            "viscous_friction": (VISCOUS, "coefficient"),
            "quadratic_drag": (DRAG, "coefficient"),
            "asymmetric_viscous_friction": (ONE_WAY, "coefficient"),
            "load_torque": (TORQUE, "torque"),
            "load_dependent_friction": (RATIO, "ratio"),
        }
        if name == "cable_spring":
            row[CABLE], row[REST] = value["stiffness"], value["rest"]
        else:
            column, key = columns[name]
            row[column] += value[key]
