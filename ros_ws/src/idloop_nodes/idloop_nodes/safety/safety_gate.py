"""The last decision before a motor: which command may pass, and what is sent where none may.

What the bridge decides itself (command, its rate, rms, soft start) is held within its limits; what the machine does
(position, velocity, work) is watched, and a breach stops the motor until a reset. Whatever comes in, what
goes out is finite and within the limits. No ROS and no clock in here: every call receives the time.
"""

from __future__ import annotations

import math

from idloop.records.bags.cdr import SECOND
from idloop_nodes.safety.command_limiter import CommandLimiter
from idloop_nodes.safety.gate_settings import GateSettings
from idloop_nodes.safety.velocity_estimator import VelocityEstimator
from idloop_nodes.streams.stream_watch import Arrival, StreamWatch

CREDIBLE = 1e100  # a larger measurement is none, and its products would overflow
AFTER_END_NS = SECOND // 2  # time for which the neutral command is repeated after deactivation; then others may send


class SafetyGate:
    """Commands and measurements in, what is to be sent out; None where nothing is.

    Times are nanoseconds of a steady clock, stamps those of the messages.

    Attributes: `active`: only an active gate lets commands pass; `reason`: why nothing passes, empty while commands do;
    `faults`: how often commands that passed were stopped; `limited`: commands that were changed by a limit.
    """

    def __init__(self, settings: GateSettings) -> None:
        self.active = False
        self.reason = "inactive"
        self.faults = 0
        self.limited = 0
        self.limiter = CommandLimiter(settings.command)
        self.commands = StreamWatch(round(settings.watchdog * SECOND))
        self.measurements = StreamWatch(round(settings.watchdog * SECOND))
        self._settings = settings
        self._follows_position = settings.neutral != "zero"
        self._velocity_estimator = VelocityEstimator()
        self._position: float | None = None
        self._held: float | None = None
        self._output: float | None = None
        self._wanted = 0.0
        self._bad_command = self._bad_measurement = ""
        self._breach = self._latched = ""
        self._forbidden: dict[str, str] = {}
        self._left_at: int | None = None

    # what comes in

    def measure(self, now_ns: int, stamp_ns: int, position: float | None, velocity: float | None) -> float | None:
        """Take in a measurement, None for what the robot does not measure; return what has to be sent at once."""
        arrival = self.measurements.update(now_ns, stamp_ns)
        if arrival is Arrival.STALE:
            return None
        self._bad_measurement = _unusable(arrival, "measurement", CREDIBLE, position=position, velocity=velocity)
        if arrival is Arrival.JUMP:
            self._velocity_estimator.clear()
        if not self._bad_measurement:
            if position is not None and velocity is None:
                velocity = self._velocity_estimator.take(stamp_ns or now_ns, position)
            self._position = position
            self._watch(now_ns, math.nan if position is None else position, math.nan if velocity is None else velocity)
        passed = not self.reason
        return self._decide(now_ns) if self._blocked(now_ns) and passed else None

    def command(self, now_ns: int, stamp_ns: int, value: float) -> float | None:
        """Take in a command; return what has to be sent."""
        arrival = self.commands.update(now_ns, stamp_ns)
        if arrival is Arrival.STALE:
            return None
        self._bad_command = _unusable(arrival, "command", math.inf, command=value)
        if not self._bad_command:
            self._wanted = value
        return self._decide(now_ns)

    def tick(self, now_ns: int) -> float | None:
        """Advance the time; return what has to be sent: the neutral command again, or what the limits now give."""
        before = self._output
        output = self._decide(now_ns)
        return output if self.reason or output != before else None

    # orders

    def forbid(self, source: str, reason: str) -> None:
        """Let no command pass for a reason that the gate cannot see; an empty reason lets them pass again.

        `source`: origin of the reason: each has one at a time.
        """
        self._forbidden[source] = reason

    @property
    def forbidden(self) -> str:
        """Why no command may pass although the streams are well; empty when there is no such reason."""
        return next(filter(None, self._forbidden.values()), "")

    def activate(self) -> None:
        """Let commands pass from the next one on, with a soft start."""
        self.active = True
        self._held = None

    def deactivate(self, now_ns: int) -> float | None:
        """Let nothing pass any more; return what has to be sent."""
        self._left_at = now_ns if self.active else self._left_at
        self.active = False
        return self._decide(now_ns)

    def stop(self, now_ns: int) -> float | None:
        """Stop until reset; return what has to be sent."""
        self._latched = "emergency stop"
        return self._decide(now_ns)

    def reset(self) -> str:
        """Forget what was latched; return why that cannot be, empty when it could."""
        if self._breach:
            return self._breach
        self._latched = ""
        return ""

    @property
    def latched(self) -> str:
        """What stays until reset, empty when nothing."""
        return self._latched

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

    def _blocked(self, now_ns: int) -> str:
        """Why nothing may pass; what stays until reset is latched on the way."""
        if not self.active:
            return "inactive"
        self._latched = self._latched or self._breach
        if self._latched:
            return self._latched
        if self.forbidden:
            return self.forbidden
        lost = self._lost(now_ns)
        if lost and self._settings.latch_watchdog:
            self._latched = lost
        if lost:
            return lost
        missing = [name for name, watch in self._streams() if not watch.begun]
        return f"no {missing[0]} yet" if missing else ""

    def _lost(self, now_ns: int) -> str:
        """Return what the watchdog finds of streams that have begun."""
        for name, watch in self._streams():
            if watch.begun and watch.silent(now_ns):
                return f"no {name} for {self._settings.watchdog:g} s"
        return self._bad_measurement or self._bad_command

    def _streams(self) -> tuple[tuple[str, StreamWatch], ...]:
        return ("measurement", self.measurements), ("command", self.commands)

    def _decide(self, now_ns: int) -> float | None:
        reason = self._blocked(now_ns)
        if reason:
            self.faults += self.active and not self.reason
            output = self._neutral()
        else:
            if self.reason:
                self.limiter.start(now_ns)
                self._held = None
            output = self._inside(self.limiter.limit(now_ns, self._wanted, self._base))
            self.limited += output != self._wanted
        self.reason = reason
        if output is None or (not self.active and not self._leaving(now_ns)):
            return None
        self._output = output
        self.limiter.sent(now_ns, output, self._base)
        return output

    def neutral_command(self, now_ns: int) -> float | None:
        """Return what has to be sent if no further call comes; None where the motor is not this gate's."""
        return self._resting() if self.active or self._leaving(now_ns) else None

    def _leaving(self, now_ns: int) -> bool:
        return self._left_at is not None and now_ns - self._left_at <= AFTER_END_NS

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


def _unusable(arrival: Arrival, stream: str, bound: float, **values: float | None) -> str:
    """Return why a message cannot be used, empty when it can."""
    if arrival is Arrival.JUMP:
        return f"the clock of the {stream} jumped"
    for name, value in values.items():
        if value is not None and not (math.isfinite(value) and abs(value) <= bound):
            return f"the {name} is not finite"
    return ""
