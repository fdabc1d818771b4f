"""What the data can show at all: per effect, before anything is ranked."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from idloop.diagnose.detection import DetectionLimit, detection_limit
from idloop.diagnose.lattice import resolution_limits
from idloop.diagnose.proposals import Proposal
from idloop.diagnose.reach import Reach, reach_of
from idloop.diagnose.scales import Sizes
from idloop.diagnose.screen import Screened
from idloop.estimate.dataset import Data
from idloop.estimate.likelihood.setting import Setting
from idloop.physics.model import Model
from idloop.physics.trial import Scales

# Twice the log-likelihood that an effect of typical strength must be worth to be found or ruled out:
# this many times what the best of the catalogue reaches by chance.
_SURE = 2.5
# Part of a trace that must not be the free parameters' own.
_OWN_PART = 3e-3
# A joint that swings this often in a sample must show; inertia of two halves against each other, in that of both.
_SWING, _HALVES = 0.1, 0.25


@dataclass(frozen=True)
class Gate:
    """What this data can show.

    Attributes
    ----------
    findings : tuple of str
        Facts about the excitation, one line each.
    testable : dict
        ``yes``, ``weak`` or ``no`` by effect and site; ``weak`` also for what begins at a level that the
        data may not have reached.
    why : dict
        One sentence by effect and site.
    from_a_level : tuple of str
        Effects that begin at a level, which the data may not have reached.
    limits : dict
        Size from which on an effect would be found, by effect and site, of those whose size has a name.
    poor : bool
        Whether the data cannot show effects that every servo axis may have.
    """

    findings: tuple[str, ...]
    testable: dict[str, str]
    why: dict[str, str]
    from_a_level: tuple[str, ...] = ()
    limits: dict[str, DetectionLimit] = field(default_factory=dict)
    poor: bool = False

    @property
    def untestable(self) -> tuple[str, ...]:
        """Effects that this data cannot show, or not beyond the level that it has reached."""
        return tuple(name for name, answer in self.testable.items() if answer == "no" or name in self.from_a_level)

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {
            "findings": list(self.findings),
            "testable": self.testable,
            "why": self.why,
            "shows_from": {name: limit.to_dict() for name, limit in self.limits.items()},
        }


def gate(model: Model, setting: Setting, screened: Sequence[Screened], chance: float) -> Gate:
    """Judge what the data can show.

    Parameters
    ----------
    model : Model
        Fitted model without the effects in question.
    setting : Setting
    screened : sequence of Screened
    chance : float
        Statistic that the best of the catalogue reaches by chance as often as the error rate allows.

    Returns
    -------
    Gate
    """
    sizes = Sizes(model, setting)
    facts = _facts(model, setting, sizes)
    testable, why, limits = {}, {}, {}
    for s in screened:
        name, limit, reach = s.proposal.name, detection_limit(s, chance), Reach()
        if limit is not None:
            scales = sizes.at(s.proposal.effect.site, s.proposal.at)
            reach = reach_of(s.proposal, limit, model, scales)
            limit = reach.within(limit)
        testable[name], why[name] = _judge(s, facts, chance, limit, reach)
        if limit is not None and testable[name] != "no":
            limits[name] = limit
            quicker = _quicker(s.proposal, limit, scales)
            if quicker:
                testable[name], why[name] = "no", quicker
    levels = tuple(s.proposal.name for s in screened if s.proposal.effect.from_a_level)
    poor = any(s.proposal.effect.everyday and testable[s.proposal.name] == "no" for s in screened)
    return Gate(facts.findings, testable, why, levels, limits | resolution_limits(model, setting), poor)


def excitation_findings(model: Model, setting: Setting) -> tuple[str, ...]:
    """Facts about the excitation, one line each.

    Parameters
    ----------
    model : Model
    setting : Setting

    Returns
    -------
    tuple of str
    """
    return _facts(model, setting, Sizes(model, setting)).findings


def _quicker(proposal: Proposal, limit: DetectionLimit, scales: Scales) -> str:
    """Why an excitation far slower than the samples cannot show what is as quick as they are; empty where it can.

    A loop that is sampled may have a delay of one sample, and a joint that swings within ten of them can be seen.
    """
    period, also = scales.sample_time, f"; {limit.text}" if limit.text else ""
    if proposal.effect.delay and limit.least > period:
        return f"a delay of one sample, {1e3 * period:.3g} ms, would not show: excite faster{also}"
    if limit.at_most:
        swing = math.sqrt(limit.least / (_HALVES * scales.inertia)) / (2.0 * math.pi)
        if swing < _SWING / period:
            return f"a joint that swings at more than {swing:.3g} Hz would not show: excite faster{also}"
    return ""


@dataclass(frozen=True)
class _Facts:
    seconds: float
    command_levels: int
    reversals: int
    turns: float
    angle: bool
    sentence: str

    @property
    def findings(self) -> tuple[str, ...]:
        """One line each."""
        found = [self.sentence]
        if self.command_levels <= 1:
            found.append("the command has one size only: what depends on its size cannot be told from the gain")
        if self.reversals < 4:
            found.append(f"the axis reverses {self.reversals} times: friction and play hardly show")
        return tuple(found)


def _facts(model: Model, setting: Setting, sizes: Sizes) -> _Facts:
    seconds = sizes.duration
    command = np.abs(np.concatenate([d.input for d in setting.data]))
    moving = command[command > 1e-3 * sizes.command_most]
    levels = len(np.unique(np.round(moving / (0.02 * sizes.command_most)))) if len(moving) else 0
    reversals = sum(_reversals(model, data) for data in setting.data)
    speed, _, _, span = sizes.bodies[0]
    angle = model.units.position == "rad"
    turns = span / (2.0 * np.pi) if angle else 0.0
    unit = model.units.position
    reach = f"{turns:.2g} turns" if angle else f"{span:.3g} {unit}"
    sentence = (
        f"{seconds:.3g} s in {len(setting.data)} record{'s' if len(setting.data) > 1 else ''}, "
        f"command up to {sizes.command_most:.3g} {model.input.unit}, motion over {reach}, "
        f"speed {speed:.3g} {unit}/s rms, {reversals} reversals"
    )
    return _Facts(seconds, levels, reversals, turns, angle, sentence)


def _reversals(model: Model, data: Data) -> int:
    """Reversals of the driven body above the noise of its sensors, as a comparison counts them."""
    from idloop.validate.doing import doing_of
    from idloop.validate.regions import since_reversal

    direction = doing_of(model, data, model.bodies[0]).direction
    return 0 if direction is None else len(since_reversal(data.time, direction)[1])


def _judge(s: Screened, facts: _Facts, chance: float, limit: DetectionLimit | None, reach: Reach) -> tuple[str, str]:
    """``yes``, ``weak`` or ``no``, and why."""
    effect = s.proposal.effect
    if not s.traces:
        return "no", "the model cannot be simulated with it on this data"
    if effect.odd and facts.command_levels <= 1:
        return "no", "the command has one size only, so the effect is a plain gain: use several amplitudes"
    if s.left < _OWN_PART:
        return "no", "on this data it does no more than the free parameters or the initial state can do"
    worth = max((t.worth for t in s.traces), default=0.0)
    from_where = "" if limit is None else limit.text
    if worth < chance:
        if limit is not None and reach.text and not from_where:
            from_where = f"to show it would have to be larger than {reach.text}, so this experiment cannot show it"
        return "no", "at its usual size it does no more than chance" + (f"; {from_where}" if from_where else "")
    if worth < _SURE * chance:
        return "weak", from_where or "only a strong effect would show"
    level = effect.from_a_level
    if level:
        return "weak", f"a {level} that this data has reached would show, one beyond it cannot"
    if effect.whole_turn and facts.turns < 1.0:
        return "weak", f"the motion covers {facts.turns:.2g} of a turn: it looks like an offset or a spring"
    return "yes", from_where or f"at its usual size it would be worth {0.5 * worth:.3g} units of log-likelihood"
