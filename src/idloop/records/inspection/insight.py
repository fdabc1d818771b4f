"""What a recording can show and what it cannot, in plain words."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from idloop.records.inspection.checks import FEWEST_SAMPLES, dead_positions, few_samples
from idloop.records.inspection.excitation import Excitation
from idloop.records.inspection.motion import Motion

FEW_TURNS = 2 * np.pi


@dataclass(frozen=True)
class Evidence:
    """What the sentences are drawn from, for one driven joint.

    Attributes
    ----------
    command : Excitation or None
        The command; None when no command topic was found.
    motions : mapping of str to Motion
        Measured signals by ``joint.field``.
    units : mapping of str to str
        Units by ``joint.field`` where the bag states them.
    closed_loop : bool
        Whether a reference was recorded.
    sample_rate : float
        Of the measurements [Hz].
    coasting : float
        Longest time with zero command while the axis moves [s].
    runs : int
        Runs that the clock was set back between.
    from_rest : bool
        Whether the axis sets off from rest as the record begins.
    """

    command: Excitation | None
    motions: Mapping[str, Motion]
    units: Mapping[str, str]
    closed_loop: bool
    sample_rate: float
    coasting: float
    runs: int = 1
    from_rest: bool = False

    @property
    def step(self) -> bool:
        """Whether the record begins with a step of its constant command."""
        return self.from_rest and self.command is not None and self.command.levels == 1 and self.command.mean != 0.0


def verdict(evidence: Evidence) -> str:
    """Return one word, those of `idloop.records.inspection.inspection.Inspection`."""
    if not evidence.motions:
        return "unreadable"
    if not any(motion.moves for motion in evidence.motions.values()):
        return "not_excited"
    if evidence.command is None:
        return "no_command"
    if evidence.command.levels == 1 and not evidence.step:
        return "not_excited"
    if dead_positions(evidence.motions):
        return "contradictory"
    if evidence.runs > 1:
        return "several_runs"
    if _count(evidence) < FEWEST_SAMPLES:
        return "too_short"
    return "short" if _few(evidence) else "usable"


def _count(evidence: Evidence) -> int:
    return max(motion.count for motion in evidence.motions.values())


def _few(evidence: Evidence) -> str:
    return few_samples(_count(evidence), (_count(evidence) - 1) / evidence.sample_rate)


def insights(evidence: Evidence) -> list[str]:
    """Return one sentence for everything worth knowing before a fit."""
    decision = verdict(evidence)
    if decision == "unreadable":
        return [
            "No measured signal could be read, so nothing can be said about motion: only rates and times are known."
        ]
    if not any(motion.moves for motion in evidence.motions.values()):
        return [
            "Nothing moves: every measured signal is constant or noise about one value, so nothing can be identified."
        ]
    said = dead_positions(evidence.motions)
    if evidence.runs > 1:
        said.append(f"Time is set back in between: {evidence.runs} runs in one bag, and a fit takes one run per bag.")
    if few := _few(evidence):
        said.append(few[:1].upper() + few[1:] + ".")
    if evidence.command is None:
        said.append("No command topic was found; name it with --command, without a command only the motion is known.")
    else:
        said += _about_command(evidence.command, evidence)
    said += _about_motion(evidence)
    if evidence.closed_loop:
        said.append(
            "The loop is closed (a reference was recorded): position hides model errors, judge a model on the"
            " command as well."
        )
    return said


def _about_command(command: Excitation, evidence: Evidence) -> list[str]:
    if evidence.step:
        text = "The command is constant and the axis sets off from rest as the record begins: a step of one level"
        seen = "shows a gain and a time constant; a dead zone, friction and a saturation look like a smaller gain"
        return [f"{text}, which {seen}."]
    if command.levels == 1:
        text = "The command is constant: gain, inertia and friction cannot be told apart, nothing can be identified"
        return [f"{text}, but beside records with other commands."]
    said = []
    if command.levels == 2:
        said.append(
            "The command has two levels: a dead zone, a saturation or a bent input curve looks like a gain and an"
            " offset, and is invisible."
        )
    elif command.levels == 3:
        said.append(
            "The command has three levels: a dead zone and a saturation of the input cannot be told from a gain."
        )
    if command.levels > 3 and command.limit_share > 0.05:
        said.append(
            f"The command sits at its limits {100 * command.limit_share:.0f} % of the time: it saturates, a limit"
            " inside the drive may be visible."
        )
    if command.sign_changes == 0:
        said.append(
            "The command never changes its sign: the dead zone and gain asymmetry stay unseen, and an offset of"
            " the input is one with friction."
        )
    low, high = command.band_hz
    said.append(
        f"90 % of the command's power lies between {low:.3g} and {high:.3g} Hz; resonances and delays far above"
        f" {command.top_hz:.3g} Hz leave no trace."
    )
    if np.isfinite(evidence.sample_rate) and command.top_hz > 0.4 * evidence.sample_rate:
        said.append(
            f"The command reaches close to half the measurement rate ({evidence.sample_rate:.4g} Hz): what"
            " happens between samples is not seen."
        )
    if evidence.coasting > 0:
        said.append(
            f"The axis coasts with zero command (up to {evidence.coasting:.2g} s): this tells a dead zone from"
            " Coulomb friction."
        )
    return said


def _about_motion(evidence: Evidence) -> list[str]:
    said = []
    positions = {
        name: motion for name, motion in evidence.motions.items() if name.endswith(".position") and motion.moves
    }
    velocities = {
        name: motion for name, motion in evidence.motions.items() if name.endswith(".velocity") and motion.moves
    }
    one_way = bool(velocities) and all(
        min(-motion.minimum, motion.maximum) < 0.05 * max(-motion.minimum, motion.maximum)
        for motion in velocities.values()
    )
    if one_way or (not velocities and positions and all(motion.reversals == 0 for motion in positions.values())):
        said.append(
            "The motion is seen one way only (or the sensor does not see its sign): Coulomb friction looks like an"
            " offset, and play or asymmetric friction is invisible."
        )
    for name, motion in positions.items():
        if evidence.units.get(name, "rad") == "rad" and motion.maximum - motion.minimum < FEW_TURNS:
            unless = "" if name in evidence.units else " (if in rad)"
            said.append(
                f"{name} covers {np.degrees(motion.maximum - motion.minimum):.3g} degrees{unless}, less than a turn:"
                " imbalance and cogging look like an offset or a spring."
            )
    for name, motion in {**positions, **velocities}.items():
        span = motion.maximum - motion.minimum
        if motion.resolution > 0.01 * span:
            said.append(
                f"{name} is coarse: steps of {motion.resolution:.3g} over a range of {span:.3g}; the quantisation"
                " is a good part of the noise."
            )
    if not velocities and positions:
        said.append(
            "Only position is measured: velocity comes from the model or a filter, never from plain differences."
        )
    if velocities and not positions:
        said.append(
            "Only velocity is measured: effects that depend on the angle (imbalance, cogging, springs) show only"
            " through its integral."
        )
    return said
