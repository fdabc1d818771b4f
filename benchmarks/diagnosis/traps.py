"""Experiments that cannot show the effect they hide, and why."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Trap:
    """An effect behind an excitation that does not show it.

    Attributes
    ----------
    why : str
        In one line.
    effect, at, machine : str
    loop, drive : str
        The only excitation.
    strengths : tuple of str
        One case each.
    scale : mapping
        Factors on the effect's values.
    values : mapping
        Values given outright.
    """

    why: str
    effect: str
    at: str
    machine: str
    loop: str
    drive: str
    strengths: tuple[str, ...] = ("clear", "dominant")
    scale: Mapping[str, float] | None = None
    values: Mapping[str, float] | None = None


_TWO = "a two-level command turns it into a gain"
_TWO_OFFSET = "a two-level command turns it into a gain and an offset"
_BELOW = "the command stays below the limit"
_SLIP = "the coupling stays below the limit"
_ARC = "the motion covers a small part of a turn"
_ONE_WAY = "the motion never reverses"
_ONE_SIGN = "the command has one sign"
_START = "an unknown starting position looks the same"
_STILL = "the machine hardly leaves its place"
_SLOW = "the excitation is far slower than the effect"
_FINE = "it is finer than the noise"
_TWIN = "with one sensor it cannot matter where the time is lost"

# fmt: off
TRAPS: tuple[Trap, ...] = (
    Trap(_TWO, "dead_zone", "input", "axis", "open", "two_level"),
    Trap(_TWO, "dead_zone", "input", "dc_motor", "open", "two_level"),
    Trap(_TWO, "dead_zone", "input", "torsion", "open", "two_level"),
    Trap(_TWO, "dead_zone", "input", "lead_screw", "open", "two_level"),
    Trap(_TWO, "saturation", "input", "axis", "open", "two_level"),
    Trap(_TWO, "saturation", "input", "dc_motor", "open", "two_level"),
    Trap(_TWO, "saturation", "input", "torsion", "open", "two_level"),
    Trap(_TWO, "saturation", "input", "lead_screw", "open", "two_level"),
    Trap(_TWO_OFFSET, "gain_asymmetry", "input", "axis", "open", "two_level"),
    Trap(_TWO_OFFSET, "gain_asymmetry", "input", "dc_motor", "open", "two_level"),
    Trap(_BELOW, "saturation", "input", "axis", "open", "multilevel", scale={"limit": 2.2}),
    Trap(_BELOW, "saturation", "input", "dc_motor", "open", "multisine", scale={"limit": 2.2}),
    Trap(_BELOW, "saturation", "input", "torsion", "open", "chirp", scale={"limit": 2.2}),
    Trap(_BELOW, "speed_limit_voltage", "input", "dc_motor", "open", "multilevel", scale={"supply": 2.4}),
    Trap(_SLIP, "slip", "motor-load1", "torsion", "open", "multilevel", scale={"limit": 3.0}),
    Trap(_SLIP, "slip", "load1-load2", "torsion", "open", "chirp", scale={"limit": 3.0}),
    Trap(_ARC, "imbalance", "axis", "axis", "closed", "small"),
    Trap(_ARC, "imbalance", "motor", "dc_motor", "closed", "small"),
    Trap(_ARC, "imbalance", "motor", "torsion", "closed", "small"),
    Trap(_ARC, "input_offset", "input", "axis", "closed", "small"),
    Trap(_ARC, "input_offset", "input", "dc_motor", "closed", "small"),
    Trap(_ARC, "input_offset", "input", "torsion", "closed", "small"),
    Trap(_ONE_WAY, "coulomb_friction", "axis", "axis", "open", "one_way"),
    Trap(_ONE_WAY, "coulomb_friction", "motor", "dc_motor", "open", "one_way"),
    Trap(_ONE_WAY, "coulomb_friction", "motor", "torsion", "open", "one_way"),
    Trap(_ONE_WAY, "asymmetric_friction", "axis", "axis", "open", "one_way"),
    Trap(_ONE_WAY, "backlash", "position[axis]", "axis", "open", "one_way"),
    Trap(_ONE_WAY, "backlash", "position[motor]", "dc_motor", "open", "one_way"),
    Trap(_ONE_SIGN, "dead_zone", "input", "axis", "open", "one_way"),
    Trap(_ONE_SIGN, "dead_zone", "input", "dc_motor", "open", "one_way"),
    Trap(_ONE_SIGN, "gain_asymmetry", "input", "axis", "open", "one_way"),
    Trap(_ONE_SIGN, "gain_asymmetry", "input", "dc_motor", "open", "one_way"),
    Trap(_START, "sensor_offset", "position[axis]", "axis", "open", "multilevel"),
    Trap(_START, "sensor_offset", "position[motor]", "dc_motor", "open", "multisine"),
    Trap(_STILL, "sensor_ripple", "velocity[axis]", "axis", "open", "crawl", ("weak", "clear")),
    Trap(_STILL, "imbalance", "axis", "axis", "open", "crawl", ("barely", "weak"), scale={"amplitude": 0.3}),
    Trap(_STILL, "quadratic_drag", "axis", "axis", "open", "crawl", ("barely",), scale={"coefficient": 0.3}),
    Trap(_SLOW, "actuator_lag", "input", "axis", "open", "slow_sines", ("barely", "weak"),
         scale={"time_constant": 0.3}),
    Trap(_SLOW, "input_delay", "input", "dc_motor", "open", "slow_sines", ("barely", "weak"), scale={"delay": 0.5}),
    Trap(_SLOW, "compliance", "axis", "axis", "open", "slow_sines", ("barely", "weak")),
    Trap(_FINE, "sensor_quantisation", "position[axis]", "axis", "open", "multilevel", ("barely",),
         scale={"resolution": 0.2}),
    Trap(_FINE, "backlash", "position[motor]", "dc_motor", "open", "slow_sines", ("barely",), scale={"gap": 0.05}),
    Trap(_TWIN, "input_delay", "input", "axis_position", "open", "chirp"),
    Trap(_TWIN, "sensor_delay", "position[motor]", "dc_position", "open", "multilevel"),
)
# fmt: on
