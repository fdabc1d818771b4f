"""Limit cycles of a relay loop without the harmonic assumption: the motion between two switchings is known exactly."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from idloop.arrays import Array
from idloop.errors import InputError
from idloop.estimation.describing_functions.elements import Relay
from idloop.estimation.describing_functions.linear_part import LinearPart, linear_part
from idloop.json_values import to_json

# Half periods that are tried, over the fastest and the slowest time constant, and how many for a factor of ten.
SHORTEST, LONGEST, PER_DECADE = 1e-5, 20.0, 40
# Phase that a ringing mode turns from one half period to the next [rad], how far it is followed, and until it decayed.
TURN, MOST_TURNS, DECAYED = 0.15, 400.0, 7.0
# Instants within a half period at which the relay's input is computed; for a radian of a ringing mode; the most.
INSTANTS, PER_RADIAN, MOST_INSTANTS = 200, 8.0, 20_000
# Of the input's swing: what rounding may leave of a threshold.
ROUNDING = 1e-9


@dataclass(frozen=True)
class RelayCycle:
    """One symmetric oscillation of a loop with a relay, exact."""

    frequency: float  # Hz
    peak: float  # greatest value of the relay's input
    amplitude: float  # first harmonic of the relay's input, to compare with a describing function
    point: complex  # g(jω) there
    stable: bool  # whether the loop returns to it after a small disturbance

    @property
    def gain(self) -> complex:
        """First harmonic of the relay's output over that of its input."""
        return -1.0 / self.point

    def to_dict(self) -> dict[str, float | bool | None]:
        """Return plain values for JSON."""
        values = {name: getattr(self, name) for name in ("frequency", "peak", "amplitude", "stable")}
        return dict(to_json({**values, "point_real": self.point.real, "point_imag": self.point.imag}))


def relay_cycles(system: Any, relay: Relay, *, delay: float = 0.0) -> tuple[RelayCycle, ...]:
    """Find the symmetric limit cycles x = −G·y, y = relay(x), that switch twice in a period.

    A describing function counts on G to take the harmonics of the relay away. This does not: between switchings the
    relay is constant, and what the linear part does then is known (Hamel's and Tsypkin's loci).

    Parameters
    ----------
    system : control.TransferFunction or control.StateSpace
        Everything linear in the loop, continuous and strictly proper.
    relay : Relay
        Without a dead zone: ideal, or with hysteresis (``off = −on``).
    delay : float
        Further delay in the loop [s]; oscillations faster than half a period of it are not looked for.

    Returns
    -------
    tuple of RelayCycle
        By growing frequency; empty where none is found.

    Raises
    ------
    InputError
        A relay with a dead zone, a sampled system, or one with a direct feedthrough.

    Notes
    -----
    With the half period T the state at a switching to +M is z = −(I + e^{AT})⁻¹ ∫₀ᵀ e^{As} ds B M, and the relay's
    input must rise through ``on`` there. With v = dz/dt just before, a disturbance of the state is after a half period
    (I − v C / (C v)) e^{AT} times what it was (Åström, Oscillations in systems with relay feedback, 1995); with a delay
    below T likewise, from crossing to crossing. References: Hamel, 1949; Tsypkin, Relay Control Systems, 1984.

    Examples
    --------
    A thermostat: the describing function never meets a lag of first order, and yet it oscillates.

    >>> import control
    >>> found, = relay_cycles(control.tf([1], [1, 1]), Relay(1.0, 0.3, -0.3))
    >>> round(found.peak, 3), round(found.frequency, 3), found.stable
    (0.3, 0.808, True)
    """
    linear = linear_part(system, delay)
    if relay.on != -relay.lower:
        raise InputError(f"{relay.name}: with a dead zone its output rests at 0; give off = −on or take limit_cycles")
    if linear.discrete:
        raise InputError("exact cycles of a relay: a continuous system is needed; take limit_cycles for a sampled one")
    if abs(float(linear.space.D[0, 0])) > 0.0:
        raise InputError("exact cycles of a relay: the linear part has a direct feedthrough; add a pole")
    sizes = np.abs(linear.space.poles())
    sizes = sizes[sizes > 1e-9 * float(np.max(sizes, initial=0.0))]
    sizes = np.append(sizes, 1.0 / delay) if delay > 0.0 else sizes
    fast, slow = (float(sizes.max()), float(sizes.min())) if sizes.size else (1.0, 1.0)
    low, high = max(SHORTEST / fast, delay * (1.0 + 1e-9)), max(LONGEST / slow, 2.0 * delay)
    parts = [np.geomspace(low, high, max(int(PER_DECADE * math.log10(high / low)), 50))]
    for pole in linear.space.poles():
        if pole.imag > 0.0:
            # As long as it rings, its phase decides where the relay switches.
            rings = min(high, MOST_TURNS / pole.imag, DECAYED / max(-pole.real, 1e-300))
            parts.append(np.arange(low, rings, TURN / pole.imag))
    tried = np.unique(np.concatenate(parts))
    return tuple(sorted(_found(linear, relay, tried), key=lambda cycle: cycle.frequency))


def _found(linear: LinearPart, relay: Relay, tried: Array) -> list[RelayCycle]:
    from scipy.optimize import brentq, minimize_scalar

    def miss(half: float) -> float:
        return _HalfPeriod(linear, relay.level, half).input_at_switching - relay.on

    with np.errstate(over="ignore", invalid="ignore"):
        left = np.array([miss(float(half)) for half in tried])
        size = np.abs(left)
        turned = np.flatnonzero((size[1:-1] < size[:-2]) & (size[1:-1] < size[2:]) & (left[:-2] * left[2:] > 0.0)) + 1
        for place in turned[left[turned] * left[turned - 1] > 0.0]:
            # Between its neighbours it comes nearest to 0, and may go through it there and back.
            sign, bounds = np.sign(left[place]), (tried[place - 1], tried[place + 1])
            lowest = minimize_scalar(lambda half, sign=sign: sign * miss(half), bounds=bounds, method="bounded")
            if lowest.fun < 0.0:
                tried, left = np.append(tried, lowest.x), np.append(left, sign * lowest.fun)
        order = np.argsort(tried)
        tried, left = tried[order], left[order]
        known = np.isfinite(left[:-1]) & np.isfinite(left[1:])
        roots = np.flatnonzero(known & (np.sign(left[:-1]) * np.sign(left[1:]) < 0.0))
        cycles = []
        for place in roots:
            half = float(brentq(miss, tried[place], tried[place + 1], xtol=1e-300, rtol=1e-12))
            cycle = _cycle(linear, relay, _HalfPeriod(linear, relay.level, half))
            if cycle is not None:
                cycles.append(cycle)
    return cycles


class _HalfPeriod:
    """Steady motion of the linear part under a square wave of a level and half a period [s]."""

    def __init__(self, linear: LinearPart, level: float, half: float) -> None:
        self.a, self.b = np.asarray(linear.space.A, dtype=float), level * np.asarray(linear.space.B, dtype=float)[:, 0]
        self.c, self.half, self.delay = np.asarray(linear.space.C, dtype=float)[0], half, linear.delay
        # The wave is +level from now on: half a period later the state is the same with the other sign.
        self.turn, push = self.over(half)
        self.first = -np.linalg.solve(np.eye(len(self.a)) + self.turn, push)

    def over(self, seconds: float) -> tuple[Array, Array]:
        """What the state does by itself, and what the level adds to it."""
        from scipy.linalg import expm

        n = len(self.a)
        both = np.zeros((n + 1, n + 1))
        both[:n, :n], both[:n, n] = self.a * seconds, self.b * seconds
        found = expm(both)
        return found[:n, :n], found[:n, n]

    @property
    def crossing(self) -> Array:
        """State as long before a switching to +level as the loop is late: its output is the relay's input then."""
        if self.delay == 0.0:
            return np.asarray(self.first)
        free, push = self.over(self.half - self.delay)
        return np.asarray(-(free @ self.first + push))

    @property
    def input_at_switching(self) -> float:
        """Relay's input where it switches to +level."""
        return -float(self.c @ self.crossing)

    def inputs(self, count: int) -> Array:
        """Relay's input but for the delay over half a period from a switching to +level, shape (count,)."""
        free, push = self.over(self.half / count)
        state, found = self.first, np.empty(count)
        for k in range(count):
            found[k] = -float(self.c @ state)
            state = free @ state + push
        return found


def _cycle(linear: LinearPart, relay: Relay, motion: _HalfPeriod) -> RelayCycle | None:
    """The cycle of a half period; None where the relay would have switched elsewhere."""
    speed = motion.a @ motion.crossing - motion.b
    rate = -float(motion.c @ speed)
    rings = float(np.max(linear.space.poles().imag, initial=0.0)) * motion.half
    count = int(min(max(INSTANTS, PER_RADIAN * rings), MOST_INSTANTS))
    shown = motion.inputs(count)
    peak = float(np.max(np.abs(shown)))
    late = motion.delay / motion.half * count
    after = np.interp(np.arange(1, count) - late, np.arange(-count, count), [*-shown, *shown])
    if not rate > 0.0 or np.any(after < -relay.on - ROUNDING * peak):
        return None
    projection = np.eye(len(motion.a)) + np.outer(speed, motion.c) / rate
    multipliers = np.abs(np.linalg.eigvals(projection @ motion.turn))
    frequency = 0.5 / motion.half
    point = complex(linear.response(frequency)[0])
    return RelayCycle(
        frequency=frequency,
        peak=peak,
        amplitude=4.0 * relay.level / math.pi * abs(point),
        point=point,
        stable=bool(np.max(multipliers, initial=0.0) < 1.0),
    )
