"""Sensors in plain Python, for the machines that MuJoCo simulates."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping, Sequence

from plain import Plain, PlainOutput


class Sensor:
    """One sensor: play, filter, delay, ripple, offset, noise, quantisation, in this order.

    Parameters
    ----------
    output : PlainOutput
    effects : mapping
        Values by name of effect.
    step : float
        Time between calls of `follow` [s].
    """

    def __init__(self, output: PlainOutput, effects: Mapping[str, Mapping[str, float]], step: float) -> None:
        self._output, self._effects, self._step = output, effects, step
        self._gap = effects.get("backlash", {}).get("gap", 0.0)
        self._tau = effects.get("velocity_filter", {}).get("time_constant", 0.0)
        self._late = effects.get("sensor_delay", {}).get("delay", 0.0) / step
        self._kept: deque[tuple[float, float]] = deque(maxlen=int(self._late) + 2)
        self._played = self._filtered = self._previous = 0.0
        self.follow(0.0, 0.0)

    @property
    def remembers(self) -> bool:
        """The sensor has to follow every step of the motion."""
        return self._gap > 0.0 or self._tau > 0.0 or self._late > 0.0

    def follow(self, position: float, velocity: float) -> None:
        """Take the motion one step on."""
        value = self._output.scale * (velocity if self._output.velocity else position)
        if self._gap > 0.0:
            low, high = value - 0.5 * self._gap, value + 0.5 * self._gap
            self._played = min(max(self._played, low), high)
            value = self._played
        if self._tau > 0.0:
            mean = 0.5 * (self._previous + value)
            self._previous = value
            self._filtered = mean + (self._filtered - mean) * math.exp(-self._step / self._tau)
            value = self._filtered
        self._kept.append((value, position))

    def read(self, noise: float) -> float:
        """What the sensor shows now."""
        back = min(self._late, len(self._kept) - 1.0)
        whole = int(back)
        new = self._kept[-1 - whole]
        old = self._kept[max(-2 - whole, -len(self._kept))]
        part = back - whole
        value = new[0] + part * (old[0] - new[0])
        angle = new[1] + part * (old[1] - new[1])
        ripple = self._effects.get("sensor_ripple")
        if ripple is not None:
            value *= 1.0 + ripple["amplitude"] * math.sin(ripple["harmonic"] * angle + ripple["phase"])
        value += self._effects.get("sensor_offset", {}).get("offset", 0.0) + noise
        resolution = self._effects.get("sensor_quantisation", {}).get("resolution", 0.0)
        return resolution * math.floor(value / resolution + 0.5) if resolution > 0.0 else value


def sensors(plain: Plain, step: float) -> Sequence[Sensor]:
    """All sensors of a machine."""
    found = []
    for index, output in enumerate(plain.outputs):
        own = {e.name: e.values for e in plain.effects if e.kind == "output" and e.index == index}
        found.append(Sensor(output, own, step))
    return found
