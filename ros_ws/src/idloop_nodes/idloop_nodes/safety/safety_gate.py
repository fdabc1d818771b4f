"""The last decision before a motor: which command may pass, and what is sent where none may."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from idloop.errors import InputError
from idloop.records.bags.cdr import SECOND
from idloop_nodes.codec.joints import NAN
from idloop_nodes.excitation.experiment import Limits
from idloop_nodes.safety.command_limiter import CommandLimiter, CommandLimits
from idloop_nodes.safety.interlock import Interlock
from idloop_nodes.streams.stream_watch import Arrival, StreamWatch

MOTION = ("position_min", "position_max", "velocity")


@dataclass(frozen=True)
class GateSettings:
    """What a gate allows, in the model's units."""

    command: CommandLimits  # of what is sent
    motion: Limits = field(default_factory=Limits)  # position and velocity of the axis
    # {"zero", "hold_measured", "hold_command"}: what is sent where nothing may move: zero (effort, velocity), or for a
    # position the one that was measured when the fault came, or the last one sent
    neutral: str = "zero"
    energy: float | None = None  # largest work, see `CommandLimiter.work`
    # The axis runs on for velocity × this after the command has ended [s]; where it would come to rest must be inside
    # the limits, too
    coast_time: float = 0.0
    watchdog: float = 0.04  # silence of command or measurement after which the motor is stopped [s]
    latch_watchdog: bool = False  # what the watchdog found stays until reset


def gate_settings(values: Mapping[str, Any]) -> GateSettings:
    """Return what the parameters allow; InputError: a limit is missing, or two contradict one another."""
    if values["limit.command"] is None:
        raise InputError("bridge: limit.command is not set; give the largest command that this motor may get")
    position = values["interface"] == "position"
    neutral = values["neutral"]
    if neutral == "auto":
        neutral = "hold_measured" if position else "zero"
    if position == (neutral == "zero"):
        right = "hold_measured or hold_command" if position else "zero"
        raise InputError(
            f"bridge: neutral {neutral} does not go with the interface {values['interface']}; give {right}"
        )
    low, high = values["limit.position_min"], values["limit.position_max"]
    if low is not None and high is not None and low >= high:
        raise InputError(f"bridge: limit.position_min {low:g} is not below limit.position_max {high:g}")
    if position and (low is None or high is None):
        raise InputError("bridge: a position interface needs limit.position_min and limit.position_max")
    if "position" not in values["fields"] and (low is not None or high is not None):
        raise InputError("bridge: a position limit needs position among fields")
    if values["limit.velocity"] is not None and not {"position", "velocity"} & set(values["fields"]):
        raise InputError("bridge: limit.velocity needs position or velocity among fields")
    limits = CommandLimits(
        command=values["limit.command"],
        rate=values["limit.command_rate"],
        rms=values["limit.rms"],
        rms_time=values["limit.rms_time"],
        energy_time=values["limit.energy_time"],
        soft_start=values["soft_start"],
        standing=values["watchdog"],
    )
    return GateSettings(
        command=limits,
        motion=Limits(None, *(values[f"limit.{name}"] for name in MOTION)),
        neutral=neutral,
        energy=values["limit.energy"],
        coast_time=values["limit.coast_time"],
        watchdog=values["watchdog"],
        latch_watchdog=values["latch_watchdog"],
    )


class VelocityEstimator:
    """Slope of the positions over a window; in a shorter one the encoder's steps would show."""

    def __init__(self, window_ns: int = 20_000_000) -> None:
        self._window_ns = window_ns
        self._positions: deque[tuple[int, float]] = deque()

    def clear(self) -> None:
        """Forget everything: the stamps have a new beginning."""
        self._positions.clear()

    def take(self, stamp_ns: int, position: float) -> float:
        """Return the velocity at a new position; NaN before the first window is full."""
        positions = self._positions
        positions.append((stamp_ns, position))
        while len(positions) > 2 and stamp_ns - positions[1][0] >= self._window_ns:
            positions.popleft()
        elapsed = stamp_ns - positions[0][0]
        return (position - positions[0][1]) * SECOND / elapsed if elapsed >= self._window_ns else NAN


class SafetyGate(Interlock[float]):
    """Commands and measurements in, what is to be sent out; None where nothing is.

    Times are nanoseconds of a steady clock, stamps those of the messages.

    Attributes beside those of `Interlock`: `limited`: commands that were changed by a limit.
    """

    def __init__(self, settings: GateSettings) -> None:
        self.limited = 0
        self.limiter = CommandLimiter(settings.command)
        self.commands = StreamWatch(round(settings.watchdog * SECOND))
        self.measurements = StreamWatch(round(settings.watchdog * SECOND))
        super().__init__(
            {"measurement": self.measurements, "command": self.commands},
            watchdog=settings.watchdog,
            latch_watchdog=settings.latch_watchdog,
        )
        self._settings = settings
        self._follows_position = settings.neutral != "zero"
        self._velocity_estimator = VelocityEstimator()
        self._position: float | None = None
        self._held: float | None = None
        self._output: float | None = None
        self._wanted = 0.0

    # what comes in

    def measure(self, now_ns: int, stamp_ns: int, position: float | None, velocity: float | None) -> float | None:
        """Take in a measurement, None for what the robot does not measure; return what has to be sent at once."""
        arrival = self.measurements.update(now_ns, stamp_ns)
        if arrival is Arrival.STALE:
            return None
        usable = self.take("measurement", arrival, position=position, velocity=velocity)
        if arrival is Arrival.JUMP:
            self._velocity_estimator.clear()
        if usable:
            if position is not None and velocity is None:
                velocity = self._velocity_estimator.take(stamp_ns or now_ns, position)
            self._position = position
            self._watch(now_ns, math.nan if position is None else position, math.nan if velocity is None else velocity)
        passed = not self.reason
        return self._decide(now_ns) if self.blocked(now_ns) and passed else None

    def command(self, now_ns: int, stamp_ns: int, value: float) -> float | None:
        """Take in a command; return what has to be sent."""
        arrival = self.commands.update(now_ns, stamp_ns)
        if arrival is Arrival.STALE:
            return None
        if self.take("command", arrival, command=value):
            self._wanted = value
        return self._decide(now_ns)

    def tick(self, now_ns: int) -> float | None:
        """Advance the time; return what has to be sent: the neutral command again, or what the limits now give."""
        before = self._output
        output = self._decide(now_ns)
        return output if self.reason or output != before else None

    # orders

    def activate(self) -> None:
        """Let commands pass from the next one on, with a soft start."""
        super().activate()
        self._held = None

    # decisions

    def _watch(self, now_ns: int, position: float, velocity: float) -> None:
        """Compare the motion of the machine with its limits."""
        settings = self._settings
        self.limiter.move(now_ns, velocity, self._base)
        self._breach = settings.motion.breach(position, velocity)
        if not self._breach:
            ahead = settings.motion.breach(position + velocity * settings.coast_time, math.nan)
            self._breach = f"coasting to {ahead}" if ahead else ""
        if not self._breach and settings.energy is not None and self.limiter.work > settings.energy:
            self._breach = f"work is more than limit.energy {settings.energy:.4g}"

    def _decide(self, now_ns: int) -> float | None:
        reason = self.blocked(now_ns)
        if reason:
            output = self._neutral()
        else:
            if self.reason:
                self.limiter.start(now_ns)
                self._held = None
            output = self._inside(self.limiter.limit(now_ns, self._wanted, self._base))
            self.limited += output != self._wanted
        self.decided(reason)
        if output is None or not self.mine(now_ns):
            return None
        self._output = output
        self.limiter.sent(now_ns, output, self._base)
        return output

    def neutral_command(self, now_ns: int) -> float | None:
        """Return what has to be sent if no further call comes; None where the motor is not this gate's."""
        return self._resting() if self.mine(now_ns) else None

    @property
    def _base(self) -> float:
        return self._position or 0.0 if self._follows_position else 0.0

    def _neutral(self) -> float | None:
        """Return the command that moves nothing; None where a position is commanded and none is known."""
        self._held = self._resting()
        return self._held

    def _resting(self) -> float | None:
        if not self._follows_position:
            return 0.0
        if self._held is not None:
            return self._held
        known = self._output if self._settings.neutral == "hold_command" else None
        known = self._position if known is None else known
        return None if known is None else self._inside(known)

    def _inside(self, value: float) -> float:
        """Return a commanded position inside the limits of the axis; other commands as they are."""
        if not self._follows_position:
            return value
        low, high = self._settings.motion.position_min, self._settings.motion.position_max
        value = value if low is None else max(value, low)
        return value if high is None else min(value, high)
