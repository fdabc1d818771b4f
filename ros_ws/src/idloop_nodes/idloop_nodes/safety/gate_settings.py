"""What the bridge allows: read from its parameters, refused where they contradict one another."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, cast

from idloop.errors import InputError
from idloop_nodes.excitation.experiment import Limits
from idloop_nodes.safety.command_limiter import CommandLimits

Neutral = Literal["zero", "hold_measured", "hold_command"]
MOTION = ("position_min", "position_max", "velocity")


@dataclass(frozen=True)
class GateSettings:
    """What a gate allows, in the model's units."""

    command: CommandLimits  # of what is sent
    motion: Limits = field(default_factory=Limits)  # position and velocity of the axis
    # {"zero", "hold_measured", "hold_command"}: what is sent where nothing may move: zero (effort, velocity), or for a
    # position the one that was measured when the fault came, or the last one sent
    neutral: Neutral = "zero"
    energy: float | None = None  # largest work, see `CommandLimiter.work`
    # The axis runs on for velocity × this after the command has ended [s]; where it would come to rest must be inside
    # the limits, too
    coast_time: float = 0.0
    watchdog: float = 0.04  # silence of command or measurement after which the motor is stopped [s]
    latch_watchdog: bool = False  # what the watchdog found stays until reset


def gate_settings(values: Mapping[str, Any]) -> GateSettings:
    """Return what the parameters allow.

    Raises InputError: a limit is missing, or two of them contradict one another.
    """
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
        neutral=cast("Neutral", neutral),
        energy=values["limit.energy"],
        coast_time=values["limit.coast_time"],
        watchdog=values["watchdog"],
        latch_watchdog=values["latch_watchdog"],
    )
