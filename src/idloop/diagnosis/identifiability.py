"""The identifiability check: whether the data can show each effect at all."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from idloop.diagnosis.evidence.detection_limit import DetectionLimit, detection_limit, needed_power
from idloop.diagnosis.evidence.quantisation import resolution_limits
from idloop.diagnosis.screening.proposals import Proposal
from idloop.diagnosis.screening.score_test import Screened
from idloop.diagnosis.screening.typical_sizes import Sizes
from idloop.estimation.dataset import Data
from idloop.estimation.likelihood.estimation_problem import EstimationProblem
from idloop.physics.effect import OUTPUT
from idloop.physics.model import Model
from idloop.physics.trial import Scales

_FOR_A_WHILE = 0.1  # part of a record in which the axis goes one way
# Least part of a trace that the free parameters must not be able to produce.
OWN_PART = 3e-3
# Why an effect that repeats over the position was not tried.
NOT_REPEATED = "the motion does not cover two of its periods, below which it is a curve over the position"


@dataclass(frozen=True)
class Gate:
    """Result of the identifiability check.

    Attributes
    ----------
    findings : tuple of str
        Facts about the excitation, one line each.
    testable : dict
        By effect and site: ``yes`` where its typical size is above the detection limit, ``weak`` between that and what
        chance does, and for what begins at a level that the data may not have reached; else ``no``.
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


def gate(model: Model, estimation: EstimationProblem, screened: Sequence[Screened], chance: float) -> Gate:
    """Check what the data can show beside a fitted model.

    `chance` is the statistic that the best of the catalogue reaches by chance with the probability of the level.
    """
    sizes = Sizes(model, estimation)
    findings, levels, turns = _excitation(model, estimation, sizes)
    testable, why, limits = {}, {}, {}
    for s in screened:
        name, scales = s.proposal.name, sizes.at(s.proposal.effect.site, s.proposal.at)
        limit, reach = detection_limit(s, chance), ""
        if limit is not None:
            most, reach = largest_size(s.proposal, limit, model, scales)
            limit = limited_to(limit, most)
        testable[name], why[name] = _testability(s, levels, turns, chance, limit, reach)
        if limit is not None and testable[name] != "no":
            limits[name] = limit
            if reason := _excited_too_slowly(s.proposal, limit, scales):
                testable[name], why[name] = "no", reason
    from_a_level = tuple(s.proposal.name for s in screened if s.proposal.effect.from_a_level)
    poor = any(s.proposal.effect.everyday and testable[s.proposal.name] == "no" for s in screened)
    return Gate(findings, testable, why, from_a_level, limits | resolution_limits(model, estimation), poor)


def excitation_findings(model: Model, estimation: EstimationProblem) -> tuple[str, ...]:
    """Facts about the excitation, one line each."""
    return _excitation(model, estimation, Sizes(model, estimation))[0]


def largest_size(proposal: Proposal, limit: DetectionLimit, model: Model, scales: Scales) -> tuple[float, str]:
    """The largest size that an effect can have on a machine, infinite without a bound, and what bounds it.

    The bound is that of the parameter, of the travel, of the speed or of the command.
    """
    spec = proposal.effect.spec(limit.parameter)
    found = [(math.inf, "")]
    bound = max(spec.max - spec.neutral, spec.neutral - spec.min)
    if math.isfinite(bound):
        found.append((bound, f"it can be, {bound:.3g} {limit.unit}".rstrip(" -")))
    travel, speed = ("the whole travel", scales.span), ("the largest speed", scales.speed_most)
    sizes = {"{position}": travel, "{input}": ("the largest command", scales.command_most)}
    if proposal.effect.site == OUTPUT:
        output = next(one for one in model.outputs if one.site == proposal.at)
        what, size = travel if output.field == "position" else speed
        sizes["{output}"] = (what, size * abs(output.scale))
    if spec.unit in sizes:
        what, size = sizes[spec.unit]
        found.append((size, f"{what} of {size:.3g} {limit.unit}"))
    return min(found, key=lambda one: one[0])


def limited_to(limit: DetectionLimit, most: float) -> DetectionLimit:
    """The detection limit without sizes above the largest."""
    if limit.at_most:
        return limit
    least, sure = (value if value <= most else math.inf for value in (limit.least, limit.sure))
    return replace(limit, least=least, sure=sure)


def _excited_too_slowly(proposal: Proposal, limit: DetectionLimit, scales: Scales) -> str:
    """Why a slow excitation cannot show a delay of one sample or a joint that swings within ten; empty where it can."""
    period, also = scales.sample_time, f"; {limit.text}" if limit.text else ""
    if proposal.effect.delay and limit.least > period:
        return f"a delay of one sample, {1e3 * period:.3g} ms, would not show: excite faster{also}"
    if limit.at_most:
        # Two equal halves swing with a quarter of the inertia of both.
        swing = math.sqrt(limit.least / (0.25 * scales.inertia)) / (2.0 * math.pi)
        if swing < 0.1 / period:
            return f"a joint that swings at more than {swing:.3g} Hz would not show: excite faster{also}"
    return ""


def _excitation(model: Model, estimation: EstimationProblem, sizes: Sizes) -> tuple[tuple[str, ...], int, float]:
    """Facts about the excitation in words, levels of what effects at the input act on, and turns of the driven body."""
    command = np.abs(sizes.drive_output)
    moving = command[command > 1e-3 * sizes.command_most]
    levels = len(np.unique(np.round(moving / (0.02 * sizes.command_most)))) if len(moving) else 0
    reversals = sum(_reversals(model, data) for data in estimation.data)
    speed, _, _, span = sizes.bodies[0]
    unit = model.units.position
    turns = span / (2.0 * np.pi) if unit == "rad" else 0.0
    reach = f"{turns:.2g} turns" if unit == "rad" else f"{span:.3g} {unit}"
    largest = max(float(np.max(np.abs(d.input))) for d in estimation.data)
    sentence = (
        f"{sizes.duration:.3g} s in {len(estimation.data)} record{'s' if len(estimation.data) > 1 else ''}, "
        f"command up to {largest:.3g} {model.input.unit}, motion over {reach}, "
        f"speed {speed:.3g} {unit}/s rms, {reversals} reversals"
    )
    findings = [sentence]
    if levels <= 1:
        findings.append(
            "the command has one size only: an effect that depends on its size cannot be told from the gain"
        )
    if reversals < 4:
        # Dry friction shows between records in opposite directions as well.
        what = "backlash hardly shows" if _both_ways(model, estimation.data) else "friction and backlash hardly show"
        findings.append(f"the axis reverses {reversals} times: {what}")
    return tuple(findings), levels, turns


def _reversals(model: Model, data: Data) -> int:
    """Reversals of the driven body above the noise of its sensors, as a comparison counts them."""
    from idloop.validation.operating_state import operating_state, since_reversal

    direction = operating_state(model, data, model.bodies[0]).direction
    return 0 if direction is None else len(since_reversal(data.time, direction)[1])


def _both_ways(model: Model, every: Sequence[Data]) -> bool:
    """Whether the driven body goes forwards for a while in one record, and backwards in the same or another one."""
    from idloop.validation.operating_state import operating_state

    directions = [operating_state(model, data, model.bodies[0]).direction for data in every]
    known = [one for one in directions if one is not None]
    return all(any(float(np.mean(one == sign)) > _FOR_A_WHILE for one in known) for sign in (-1.0, 1.0))


def _testability(
    s: Screened, levels: int, turns: float, chance: float, limit: DetectionLimit | None, reach: str
) -> tuple[str, str]:
    """``yes``, ``weak`` or ``no``, and why."""
    effect = s.proposal.effect
    if not s.tried:
        return "no", NOT_REPEATED
    if not s.traces:
        return "no", "the model cannot be simulated with it on this data"
    if effect.odd and levels <= 1:
        return "no", "the command has one size only, so the effect is a plain gain: use several amplitudes"
    if s.own_part < OWN_PART:
        return "no", "on this data the free parameters or the initial state can do the same"
    typical = max(t.typical for t in s.traces)
    from_where = "" if limit is None else limit.text
    if typical < chance:
        if reach and not from_where:
            from_where = f"to show it would have to be larger than {reach}, so this experiment cannot show it"
        return "no", "at its typical size it is within chance" + (f"; {from_where}" if from_where else "")
    if all(t.typical < needed_power(chance) * t.uneven for t in s.traces):
        return "weak", from_where or "only a strong effect would show"
    if effect.from_a_level:
        return "weak", f"a {effect.from_a_level} that this data has reached would show, one beyond it cannot"
    if effect.whole_turn and turns < 1.0:
        return "weak", f"the motion covers {turns:.2g} of a turn: it looks like an offset or a spring"
    return "yes", from_where or f"at its typical size it would gain {0.5 * typical:.3g} units of log-likelihood"
