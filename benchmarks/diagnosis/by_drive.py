"""A simulator of real drives: one or two bodies with everything that a data sheet does not tell.

It is written from the equations alone and shares no code with idloop nor with the other simulators. Leapfrog steps of
at most 20 microseconds. All dry friction is of the LuGre kind (Canudas de Wit and others, 1995), its bristles solved
exactly for the speed of a step; the drive is a delay, a limit and a first-order current loop under a rippling supply;
the velocity is the difference of two encoder readings. The samples are taken when the controller really ticks.
"""

from __future__ import annotations

import math

import numpy as np
from nuisances import SUPPLY_HZ, Nuisances
from numba import njit
from numpy.typing import NDArray
from plain import Plain, PlainEffect

Array = NDArray[np.float64]

LONGEST_STEP = 2e-5
# Bristles swing no faster than this [rad/s], so that a step resolves them, and are damped by this share.
FASTEST_BRISTLE, BRISTLE_DAMPING = 1.2e4, 0.5

# Columns. The drive:
GAIN, DELAY, LIMIT, OFFSET, DEAD, LAG, SUPPLY, WITH_CURRENT, CURRENT_HARMONIC, CURRENT_PHASE = range(10)
# Bodies:
INERTIA, VISCOUS, UP, DOWN, BREAK_AWAY, S_SPEED, STIFF, DAMP, CABLE, REST, TORQUE = range(11)
CHANGING, PLACE, PHASE, WARMING, WARM_UP, C_SPEED, WAVE = range(11, 18)
WAVES = 6  # amplitude, harmonic and phase of up to so many forces over the position
# The coupling:
STIFFNESS, DAMPING, GAP = range(3)
# The state: position, velocity and bristle of either body, the current, how fast either bristle bends.
CURRENT, BENDING, STATE = 6, 7, 9


@njit(cache=True)
def _reached(drive: Array, command: float) -> float:
    """What the current loop is asked for."""
    value = min(max(command, -drive[LIMIT]), drive[LIMIT]) + drive[OFFSET]
    if value > drive[DEAD]:
        return value - drive[DEAD]
    if value < -drive[DEAD]:
        return value + drive[DEAD]
    return 0.0


@njit(cache=True)
def _bristle_limit(row: Array, v: float) -> float:
    level = row[UP] if v > 0.0 else row[DOWN]
    ratio = v / row[S_SPEED]
    return level * (1.0 + (row[BREAK_AWAY] - 1.0) * math.exp(-ratio * ratio)) / row[STIFF]


@njit(cache=True)
def _on_body(row: Array, x: float, v: float, z: float, bending: float, t: float) -> float:
    """Everything that acts on a body from its own motion."""
    f = row[TORQUE] - row[VISCOUS] * v - row[CABLE] * (x - row[REST])
    for w in range(WAVES):
        if row[WAVE + 3 * w] != 0.0:
            f -= row[WAVE + 3 * w] * math.sin(row[WAVE + 3 * w + 1] * x + row[WAVE + 3 * w + 2])
    if row[UP] > 0.0:
        f -= row[STIFF] * z + row[DAMP] * bending
    if row[CHANGING] > 0.0:
        warm = 1.0 - math.exp(-t / row[WARM_UP])
        share = math.sin(row[PLACE] * x + row[PHASE]) - row[WARMING] * warm
        f -= row[CHANGING] * share * math.tanh(v / row[C_SPEED])
    return f


@njit(cache=True)
def _carried(coupling: Array, twist: float, rate: float) -> float:
    """Force through the coupling."""
    half = 0.5 * coupling[GAP]
    if half > 0.0 and abs(twist) <= half:
        return 0.0
    return coupling[STIFFNESS] * (twist - half * np.sign(twist)) + coupling[DAMPING] * rate


@njit(cache=True)
def _advance(drive: Array, bodies: Array, coupling: Array, ticks: Array, commands: Array, sample: int,
             disturbance: float, longest: float, state: Array) -> None:  # fmt: skip
    """Run from one tick to the next."""
    n = bodies.shape[0]
    begin, span = ticks[sample], ticks[sample + 1] - ticks[sample]
    steps = math.ceil(span / longest)
    h = span / steps
    force = np.zeros(n)
    for step in range(steps):
        t = begin + (step + 0.5) * h
        latest = sample
        while latest >= 0 and ticks[latest] + drive[DELAY] > t:
            latest -= 1
        wanted = _reached(drive, commands[latest] if latest >= 0 else 0.0)
        if drive[LAG] > 0.0:
            state[CURRENT] = wanted + (state[CURRENT] - wanted) * math.exp(-h / drive[LAG])
        else:
            state[CURRENT] = wanted
        for i in range(n):
            state[i] += 0.5 * h * state[2 + i]
        strength = 1.0 + drive[SUPPLY] * math.sin(2.0 * math.pi * SUPPLY_HZ * t)
        strength += drive[WITH_CURRENT] * math.sin(drive[CURRENT_HARMONIC] * state[0] + drive[CURRENT_PHASE])
        for i in range(n):
            force[i] = _on_body(bodies[i], state[i], state[2 + i], state[4 + i], state[BENDING + i], t)
        force[0] += drive[GAIN] * strength * state[CURRENT] + disturbance
        if n > 1:
            carried = _carried(coupling, state[0] - state[1], state[2] - state[3])
            force[0] -= carried
            force[1] += carried
        for i in range(n):
            v = state[2 + i] + h * force[i] / bodies[i, INERTIA]
            mean = 0.5 * (state[2 + i] + v)
            if bodies[i, UP] > 0.0 and mean != 0.0:
                limit = _bristle_limit(bodies[i], mean)
                end = limit if mean > 0.0 else -limit
                bent = end + (state[4 + i] - end) * math.exp(-abs(mean) * h / limit)
                state[BENDING + i] = (bent - state[4 + i]) / h
                state[4 + i] = bent
            state[2 + i] = v
            state[i] += 0.5 * h * v


class DriveMachine:
    """A drive that is stepped from tick to tick.

    Parameters
    ----------
    plain : Plain
        The machine and its dominant effects.
    nuisances : Nuisances or None
        Its small things; None for a machine without them and with ideal sensors.
    ticks : ndarray (n + 1,)
        When samples are taken [s].
    rate : float
        Nominal samples per second: what the velocity is computed with.

    Attributes
    ----------
    states : ndarray (n + 1, 9)
        The true motion at the ticks: positions, velocities and bristles of both bodies, current, speed of the bristles.
    """

    def __init__(self, plain: Plain, nuisances: Nuisances | None, ticks: Array, rate: float) -> None:
        self._drive, self._bodies, self._coupling = tables(plain, nuisances)
        self._outputs, self._nuisances, self._ticks, self._rate = plain.outputs, nuisances, ticks, rate
        self._commands = np.zeros(len(ticks))
        self._sample = 0
        self.states = np.zeros((len(ticks), STATE))
        self._previous: dict[int, float] = {}
        self._slope: dict[int, float] = {}

    def measure(self, noise: Array) -> Array:
        """Read the sensors now; the noise is that before the encoder's rounding."""
        state = self.states[self._sample]
        own = self._nuisances
        counts = (0.0, 0.0) if own is None else own.counts
        shown: dict[int, float] = {}
        for output, error in zip(self._outputs, noise, strict=True):
            if not output.velocity:
                count = counts[output.body]
                value = float(state[output.body] + error)
                shown[output.body] = count * math.floor(value / count + 0.5) if count > 0.0 else value
        reading = np.empty(len(noise))
        for j, output in enumerate(self._outputs):
            reading[j] = shown[output.body]
            if output.velocity:
                change = (shown[output.body] - self._previous.get(output.body, shown[output.body])) * self._rate
                share = 1.0 if own is None else 1.0 / (1.0 + own.velocity_filter * self._rate)
                before = self._slope.get(output.body, 0.0)
                self._slope[output.body] = reading[j] = before + share * (change - before)
        self._previous = shown
        return reading

    def step(self, command: float, disturbance: float) -> None:
        """Hold a command and a disturbance until the next tick."""
        k = self._sample
        self._commands[k] = command
        self.states[k + 1] = self.states[k]
        _advance(self._drive, self._bodies, self._coupling, self._ticks, self._commands, k, disturbance,
                 LONGEST_STEP, self.states[k + 1])  # fmt: skip
        self._sample += 1


def run_from(tables: tuple[Array, Array, Array], ticks: Array, commands: Array, first: int, count: int, state: Array,
             longest: float) -> Array:  # fmt: skip
    """The state some samples after one that is known, under the commands of a record."""
    state = state.copy()
    for sample in range(first, first + count):
        _advance(*tables, ticks, commands, sample, 0.0, longest, state)
    return state


def tables(plain: Plain, nuisances: Nuisances | None) -> tuple[Array, Array, Array]:
    """Drive, bodies and coupling as the compiled functions read them.

    Raises
    ------
    ValueError
        An effect that this simulator does not know.
    """
    n = len(plain.inertia)
    drive = np.zeros(10)
    drive[GAIN], drive[LIMIT] = plain.gain, np.inf
    bodies = np.zeros((n, WAVE + 3 * WAVES))
    bodies[:, INERTIA], bodies[:, VISCOUS] = plain.inertia, plain.viscous
    bodies[:, [BREAK_AWAY, S_SPEED, WARM_UP, C_SPEED]] = 1.0
    coupling = np.zeros(3)
    if n > 1:
        coupling[STIFFNESS], coupling[DAMPING] = plain.stiffness[0], plain.damping[0]
    if nuisances is not None:
        _write_nuisances(nuisances, drive, bodies)
    for effect in plain.effects:
        _write(effect, drive, bodies, coupling)
    for row in bodies:
        level = max(row[UP], row[DOWN])
        if level > 0.0:
            least = level / (row[INERTIA] * FASTEST_BRISTLE**2)
            row[STIFF] = level / max(least, 0.0 if nuisances is None else nuisances.reach)
            row[DAMP] = 2.0 * BRISTLE_DAMPING * math.sqrt(row[STIFF] * row[INERTIA])
    return drive, bodies, coupling


def _add_wave(row: Array, amplitude: float, harmonic: float, phase: float) -> None:
    free = next(w for w in range(WAVES) if row[WAVE + 3 * w] == 0.0)
    row[WAVE + 3 * free : WAVE + 3 * free + 3] = amplitude, harmonic, phase


def _write_nuisances(own: Nuisances, drive: Array, bodies: Array) -> None:
    """Enter the small things."""
    drive[DELAY], drive[LAG] = own.delay, 1.0 / (2.0 * math.pi * own.current_loop)
    drive[LIMIT], drive[SUPPLY] = own.limit, own.supply_ripple
    if own.torque_ripple:
        drive[[WITH_CURRENT, CURRENT_HARMONIC, CURRENT_PHASE]] = own.ripple_with_current, *own.torque_ripple[0][1:]
    for wave in own.torque_ripple:
        _add_wave(bodies[0], *wave)
    bodies[:, UP] += own.friction
    bodies[:, DOWN] += own.friction
    bodies[:, BREAK_AWAY], bodies[:, S_SPEED] = own.break_away, own.stribeck_speed
    bodies[0, [CHANGING, PLACE, PHASE]] = own.unexplained, own.wave, own.phase
    bodies[0, [WARMING, WARM_UP, C_SPEED]] = own.warming, own.warm_up, own.unexplained_speed


def _write(effect: PlainEffect, drive: Array, bodies: Array, coupling: Array) -> None:
    """Enter a dominant effect."""
    value, row = effect.values, bodies[effect.index] if effect.kind == "body" else None
    name = f"{effect.kind} {effect.name}"
    if name == "input input_delay":
        drive[DELAY] += value["delay"]
    elif name == "input saturation":
        drive[LIMIT] = value["limit"]
    elif name == "input input_offset":
        drive[OFFSET] = value["offset"]
    elif name == "input dead_zone":
        drive[DEAD] = value["width"]
    elif name == "coupling backlash":
        coupling[GAP] = value["gap"]
    elif row is None:
        raise ValueError(f"no such effect in this simulator: {name}")
    elif effect.name == "coulomb_friction":
        row[[UP, DOWN]] += value["level"]
    elif effect.name == "asymmetric_friction":
        row[UP] += value["level"] * (1.0 + value["ratio"])
        row[DOWN] += value["level"] * (1.0 - value["ratio"])
    elif effect.name == "stribeck_friction":
        # all of the body's friction falls alike
        row[[UP, DOWN]] += value["coulomb"]
        row[BREAK_AWAY], row[S_SPEED] = value["static"] / value["coulomb"], value["velocity"]
    elif effect.name == "load_torque":
        row[TORQUE] += value["torque"]
    elif effect.name == "cable_spring":
        row[CABLE], row[REST] = value["stiffness"], value["rest"]
    elif effect.name == "periodic_force":
        _add_wave(row, value["amplitude"], 2.0 * math.pi / value["period"], value["phase"])
    elif effect.name in ("imbalance", "cogging"):
        _add_wave(row, value["amplitude"], value.get("harmonic", 1.0), value["phase"])
    else:
        raise ValueError(f"no such effect in this simulator: {name}")
