"""What a recording can show and what it cannot, in sentences for the user."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from idloop.records.inspection.checks import FEWEST_SAMPLES, dead_positions, few_samples
from idloop.records.inspection.excitation import Excitation
from idloop.records.inspection.motion import Motion

_TURN = 2 * np.pi
_NEAR_NYQUIST = 0.4  # of the sample rate
_ONE_WAY = 0.05  # largest speed in one direction over that in the other


@dataclass(frozen=True)
class Evidence:
    """Numbers from which the sentences are derived, for one driven joint."""

    command: Excitation | None  # None when no command topic was found
    motions: Mapping[str, Motion]  # measured signals by ``joint.field``
    units: Mapping[str, str]  # units by ``joint.field`` where the bag states them
    closed_loop: bool  # whether a reference was recorded
    sample_rate: float  # rate of the measurements [Hz]
    coasting: float  # longest time with zero command while the axis moves [s]
    runs: int = 1  # runs between which the clock was set back
    from_rest: bool = False  # whether the axis starts from rest as the record begins

    @property
    def step(self) -> bool:
        """Whether the record begins with a step of its constant command."""
        return self.from_rest and self.command is not None and self.command.levels == 1 and self.command.mean != 0.0

    @property
    def moves(self) -> bool:
        """Whether some measured signal moves."""
        return any(motion.moves for motion in self.motions.values())

    @property
    def samples(self) -> int:
        """Samples of the signal with the most of them."""
        return max(motion.count for motion in self.motions.values())

    def few_samples(self) -> str:
        """What there is to say of a short record; empty for others."""
        return few_samples(self.samples, (self.samples - 1) / self.sample_rate)


def verdict(evidence: Evidence) -> str:
    """Return one of the verdicts of `idloop.records.Inspection`."""
    command = evidence.command
    if not evidence.motions:
        return "unreadable"
    if not evidence.moves:
        return "not_excited"
    if command is None:
        return "no_command"
    if command.levels == 1 and not evidence.step:
        return "not_excited"
    if dead_positions(evidence.motions):
        return "contradictory"
    if evidence.runs > 1:
        return "several_runs"
    if evidence.samples < FEWEST_SAMPLES:
        return "too_short"
    return "short" if evidence.few_samples() else "usable"


def insights(evidence: Evidence) -> list[str]:
    """Return one sentence for everything worth knowing before a fit."""
    if not evidence.motions:
        return ["No measured signal can be read: only rates and times are known."]
    if not evidence.moves:
        text = (
            "Nothing moves: every measured signal is constant or noise around one value, so nothing can be identified"
        )
        return [f"{text}. Command a larger motion, or check the sensors."]
    found = [f"{text}." for text in dead_positions(evidence.motions)]
    if evidence.runs > 1:
        found.append(f"The clock was set back: {evidence.runs} runs in one bag. Record one run per bag.")
    if few := evidence.few_samples():
        found.append(few[:1].upper() + few[1:] + ".")
    if evidence.command is None:
        found.append("No command topic was found: name it with --command, nothing can be fitted without it.")
    else:
        found += _about_command(evidence.command, evidence)
    found += _about_motion(evidence)
    if evidence.closed_loop:
        found.append(
            "The loop is closed (a reference was recorded): the feedback hides model errors in the position. Judge a"
            " model by the command as well."
        )
    return found


def _about_command(command: Excitation, evidence: Evidence) -> list[str]:
    if evidence.step:
        text = (
            "The command is constant and the axis starts from rest as the record begins, a step of one level: it shows"
        )
        seen = "a gain and a time constant, but a dead zone, friction or a saturation looks like a smaller gain"
        return [f"{text} {seen}. Record steps to several levels."]
    if command.levels == 1:
        text = "The command is constant: gain, inertia and friction cannot be separated and nothing can be identified"
        return [f"{text}, unless together with records of other commands."]
    found = []
    if command.levels == 3:
        found.append(
            "The command has three levels: a dead zone and a saturation of the input cannot be separated from a gain."
            " Use more levels to see them."
        )
    if command.sign_changes == 0:
        found.append(
            "The command never changes its sign: a dead zone and a gain asymmetry cannot be seen, and an offset of the"
            " input cannot be separated from friction. Command both directions."
        )
    low, high = command.band_hz
    found.append(
        f"90 % of the command's power lies between {low:.3g} and {high:.3g} Hz: resonances and delays far above"
        f" {command.top_hz:.3g} Hz cannot be seen."
    )
    if np.isfinite(evidence.sample_rate) and command.top_hz > _NEAR_NYQUIST * evidence.sample_rate:
        found.append(
            f"The command has power close to half the measurement rate ({evidence.sample_rate:.4g} Hz): the motion"
            " between samples is not seen. Measure at a higher rate."
        )
    if evidence.coasting > 0:
        found.append(
            f"The axis coasts with zero command (up to {evidence.coasting:.2g} s): this separates a dead zone from"
            " Coulomb friction."
        )
    return found


def _about_motion(evidence: Evidence) -> list[str]:
    positions, velocities = (
        {name: one for name, one in evidence.motions.items() if one.moves and name.endswith(field)}
        for field in (".position", ".velocity")
    )
    found = []
    if velocities:
        speeds = [sorted((-motion.minimum, motion.maximum)) for motion in velocities.values()]
        one_way = all(slow < _ONE_WAY * fast for slow, fast in speeds)
    else:
        one_way = bool(positions) and all(motion.reversals == 0 for motion in positions.values())
    if one_way:
        found.append(
            "The motion goes one way only, or the sensor does not show its sign: Coulomb friction looks like an offset,"
            " and play or asymmetric friction cannot be seen. Move to and fro."
        )
    for name, motion in positions.items():
        span = motion.maximum - motion.minimum
        if evidence.units.get(name, "rad") == "rad" and span < _TURN:
            unless = "" if name in evidence.units else " (if it is in rad)"
            found.append(
                f"{name} covers {np.degrees(span):.3g} degrees{unless}, less than a turn: imbalance and cogging look"
                " like an offset or a spring."
            )
    if positions and not velocities:
        found.append("Only position is measured: the velocity is estimated by the model, not by differences.")
    if velocities and not positions:
        found.append(
            "Only velocity is measured: effects that depend on the angle (imbalance, cogging, springs) appear only"
            " through its integral."
        )
    return found
