"""A loop of a linear part and a nonlinear element, simulated: the check of a predicted limit cycle."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from typing import Any

import numpy as np

from idloop.arrays import Array
from idloop.errors import InputError
from idloop.estimation.black_box.labels import new_axes
from idloop.estimation.describing_functions.describing_function import HARMONICS
from idloop.estimation.describing_functions.elements import Element
from idloop.estimation.describing_functions.limit_cycle import LimitCycle
from idloop.estimation.describing_functions.linear_part import LinearPart, linear_part
from idloop.estimation.describing_functions.relay_cycle import RelayCycle
from idloop.estimation.describing_functions.sine_fit import refine_frequency, sine_fit
from idloop.json_values import to_json

# The last periods, over which amplitude and frequency are measured, and what they may differ by.
MEASURED, STEADY = 10, 0.01
# Below this part of the amplitude at the start an oscillation counts as died out.
DIED = 1e-3


@dataclass(frozen=True, eq=False)
class LoopSimulation:
    """What a loop does that was started near a limit cycle."""

    time: Array  # shape (n,): seconds
    signal: Array  # shape (n,): input of the element
    # Of the first harmonic over the last periods; the frequency [Hz] is NaN where it died out or ran away
    amplitude: float
    frequency: float
    distortion: float  # total harmonic distortion of the signal over the last periods; NaN with the frequency
    steady: bool  # whether the last periods are alike: a limit cycle

    def to_dict(self) -> dict[str, float | bool | None]:
        """Return the figures as plain values for JSON."""
        return dict(to_json({name: getattr(self, name) for name in ("amplitude", "frequency", "distortion", "steady")}))

    def plot(self, axes: Any = None, unit: str = "") -> Any:
        """Draw the element's input over time; returns the matplotlib axes."""
        ax = new_axes(axes)
        ax.plot(self.time, self.signal, color="C0", linewidth=0.8, label="simulated")
        if self.steady:
            for sign in (-1.0, 1.0):
                text = f"first harmonic: A {self.amplitude:.4g}, {self.frequency:.4g} Hz" if sign > 0 else None
                ax.axhline(sign * self.amplitude, color="C1", linestyle="--", label=text)
        ax.set(xlabel="time [s]", ylabel=f"input of the element [{unit}]" if unit else "input of the element")
        ax.legend(frameon=False)
        return ax


def simulate_loop(
    system: Any,
    element: Element,
    cycle: LimitCycle | RelayCycle,
    *,
    delay: float = 0.0,
    start: float = 1.0,
    periods: int = 60,
    steps: int = 1000,
) -> LoopSimulation:
    """Simulate the loop x = −G·y, y = element(x), from the motion of a predicted limit cycle.

    Parameters
    ----------
    system : control.TransferFunction or control.StateSpace
        The linear part, strictly proper (or sampled and with a delay).
    element : Element
        A closed-form element or a `EffectElement`.
    cycle : LimitCycle or RelayCycle
        Where to start, and how fast it turns.
    delay : float
        Further delay in the loop [s]; of a sampled loop, whole samples.
    start : float
        Amplitude at the start over the predicted one.
    periods : int
        Predicted periods to simulate, 20 or more.
    steps : int
        Steps per predicted period of a continuous loop, in which the element's output is held.

    Raises
    ------
    InputError
        A direct feedthrough, a delay that is no whole number of samples, or counts out of range.
    """
    linear = linear_part(system, delay)
    if periods < 2 * MEASURED or steps < 16:
        raise InputError(f"simulation of a loop: {periods} periods of {steps} steps; take 20 and 16 or more")
    if linear.discrete:
        interval, late = linear.sample_time, linear.whole_delay()
    else:
        interval = 1.0 / (cycle.frequency * steps)
        late = math.ceil(linear.delay / interval - 1e-9)
        interval = linear.delay / late if late else interval
    if late == 0 and abs(float(linear.space.D[0, 0])) > 0.0:
        raise InputError("simulation of a loop: the linear part has a direct feedthrough; add its delay or a pole")
    count = math.ceil(periods / (cycle.frequency * interval))
    with np.errstate(over="ignore", invalid="ignore"):
        signal = _run(linear, element, cycle, start, interval, late, count)
    time = np.asarray(interval * np.arange(signal.size), dtype=np.float64)
    return _measured(time, signal, cycle, start, signal.size == count)


def _run(
    linear: LinearPart,
    element: Element,
    cycle: LimitCycle | RelayCycle,
    start: float,
    interval: float,
    late: int,
    count: int,
) -> Array:
    space, omega = linear.space, 2.0 * math.pi * cycle.frequency
    a, b, c = (np.asarray(one, dtype=float) for one in (space.A, space.B[:, 0], space.C[0]))
    d = float(space.D[0, 0])
    point = np.exp(1j * omega * interval) if linear.discrete else 1j * omega
    # The motion of the predicted cycle: phasors of x, of the element's answer, and of the state behind the delay.
    answer = cycle.gain * start * cycle.amplitude
    motion = np.linalg.solve(point * np.eye(a.shape[0]) - a, b * answer * np.exp(-1j * omega * linear.delay))
    state = np.imag(motion)
    # A continuous element is asked for the middle of the step over which its answer is held.
    ahead, push = c, 0.0
    if not linear.discrete:
        from scipy.signal import cont2discrete

        continuous = (a, b[:, None], c[None, :], np.zeros((1, 1)))
        half, entry, *_ = cont2discrete(continuous, 0.5 * interval)
        ahead, push = c @ half, float(c @ entry[:, 0])
        a, b, *_ = cont2discrete(continuous, interval)
        b = b[:, 0]
    past = deque(np.imag(answer * np.exp(1j * omega * interval * np.arange(-late, 0))).tolist())
    respond = element.answer(interval)
    # One period of the sine puts an element with memory where the cycle has it.
    turn = max(round(1.0 / (cycle.frequency * interval)), 1)
    size, x, arriving = start * cycle.amplitude, 0.0, 0.0
    for k in range(-turn, 0):
        phase = omega * interval * k
        x = size * math.sin(phase)
        arriving = respond(x, size * omega * math.cos(phase), -size / omega * math.cos(phase))
    total = -size / omega
    signal = np.empty(count)
    for k in range(count):
        before = x
        # Without a delay the linear part has no feedthrough, so what arrives now does not matter yet.
        arriving = past[0] if late else arriving
        x = -float(ahead @ state) - (push + d * (late > 0)) * arriving
        signal[k] = x
        if not abs(x) < 1e6 * size:
            return signal[:k]
        past.append(respond(x, (x - before) / interval, total))
        total += x * interval
        arriving = past.popleft()
        state = a @ state + b * arriving
    return signal


def _measured(time: Array, signal: Array, cycle: LimitCycle | RelayCycle, start: float, whole: bool) -> LoopSimulation:
    """Figures of the last periods."""
    last = time >= time[-1] - 2.0 * MEASURED / cycle.frequency
    swing = 0.5 * float(np.ptp(signal[last]))
    t, x = time[last], signal[last] - signal[last].mean()
    up = np.flatnonzero((x[:-1] < 0.0) & (x[1:] >= 0.0))
    if not whole or swing < DIED * start * cycle.amplitude or up.size < MEASURED:
        size = swing if whole else math.inf
        return LoopSimulation(time, signal, size, frequency=math.nan, distortion=math.nan, steady=False)
    crossing = t[up] - x[up] * (t[up + 1] - t[up]) / (x[up + 1] - x[up])
    frequency = refine_frequency(t, x, (up.size - 1) / float(crossing[-1] - crossing[0]))
    halves = []
    for stop in (t[0] + MEASURED / frequency, t[-1]):
        part = (t > stop - 0.8 * MEASURED / frequency) & (t <= stop)
        halves.append(abs(sine_fit(t[part], x[part], frequency, 1, trend=False).phasors[0]))
    one = t > t[-1] - math.floor((t[-1] - t[0]) * frequency) / frequency
    harmonics = min(HARMONICS, math.ceil(0.5 / (frequency * float(t[1] - t[0]))) - 1)
    fit = sine_fit(t[one], x[one], frequency, harmonics, trend=False)
    steady = bool(abs(halves[1] / halves[0] - 1.0) < STEADY)
    return LoopSimulation(time, signal, abs(fit.phasors[0]), frequency, fit.distortion, steady=steady)
