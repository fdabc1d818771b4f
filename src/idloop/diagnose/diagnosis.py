"""What is missing from a model: gate, screening, refits, calibrated evidence, ties, a verdict."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from idloop.diagnose.calibrate import calibrate
from idloop.diagnose.candidate import Candidate, Rung, effect_parameters
from idloop.diagnose.confirm import Confirmed, confirm, confirm_behind_noise, promising
from idloop.diagnose.disturbance import LONG_MEMORY
from idloop.diagnose.evidence import consistent, distinguishable, holds, may_decide, rank, statistic
from idloop.diagnose.follows import OTHERWISE, REFUSED, REVERSED, UNMOVED, follows, reversed_command
from idloop.diagnose.footing import beside_the_noise_of, same_footing
from idloop.diagnose.foretells import foretells
from idloop.diagnose.gate import Gate, gate
from idloop.diagnose.intervals import with_stderr
from idloop.diagnose.leap import Leap
from idloop.diagnose.learnt import remaining
from idloop.diagnose.listing import all_candidates, p_value_of, pair_candidates
from idloop.diagnose.pairs import (
    MissingPair,
    Pairs,
    confirm_pairs,
    judge_pairs,
    promising_pairs,
    single_share,
    tied_members,
)
from idloop.diagnose.proposals import Proposal, proposals
from idloop.diagnose.reach import at_its_bound
from idloop.diagnose.refit import Refit
from idloop.diagnose.rivals import with_rivals
from idloop.diagnose.screen import Screen, Screened
from idloop.diagnose.setting import Setting
from idloop.diagnose.slight import same_motion, too_slight
from idloop.diagnose.stand_in import stands_in
from idloop.diagnose.twins import Twins, find_twins
from idloop.diagnose.unknown import UnknownStructure, unknown_structure
from idloop.diagnose.verdict import ADEQUATE, MISSING, NOT_EXCITED, UNKNOWN
from idloop.estimate.innovations import InnovationCriterion
from idloop.estimate.whitening import choose_order
from idloop.physics.model import Model

Progress = Callable[[float, str], None]

# A whitening of so many lags that makes the errors' deviations smaller by more than this [log] has swallowed
# an effect; what an effect's refit must then gain beyond the usual threshold, as a multiple of it.
MANY_LAGS, MUCH_COLOUR, ALLOWANCE = 6, 0.05, 3.0
# Fewer lags that do so by this much: noise with a memory of a hundred samples would not.
ANY_COLOUR = 2.5

_UNFOLLOWED = (UNMOVED, OTHERWISE)


@dataclass(frozen=True)
class Diagnosis:
    """What a model lacks on a set of records.

    Attributes
    ----------
    model : Model
        The model, its free parameters refitted.
    candidates : tuple of Candidate
        All effects that were weighed, best first.
    set : tuple of str
        Effects that this data cannot tell from the best one, itself first; empty when none is significant.
        Of a pair: those that would do in the place of its first, beside its second.
    verdict : {"missing", "adequate", "unknown_structure", "not_excited"}
    gate : Gate
        What this data can show.
    unknown : UnknownStructure or None
        What remains when no effect of the catalogue explains it.
    criterion : str
        What the models were measured by.
    level : float
        Family-wise error rate, of which single effects have four fifths and pairs one fifth where pairs
        are searched; p-values are divided by these shares, so that both are held against the level itself.
    fit : Refit or None
        The refitted model, where a search can go on from; None by the force balance.
    best_fit : Refit or None
        With the best effect, or with both of a pair.
    pair : tuple of str, or None
        The best effect and the one without which it does not show: no single effect is significant,
        the two together are, and the models of both candidates have both.
    rival_pairs : tuple of tuple of str
        Pairs that this data cannot tell from it.
    alone : Candidate or None
        The first effect of the pair with the model that has no other: where a ladder comes by.
    passed_over : mapping of str to str
        Effects that are significant on the fitted data and not missing physics, and why.
    """

    model: Model
    candidates: tuple[Candidate, ...]
    set: tuple[str, ...]
    verdict: str
    gate: Gate
    unknown: UnknownStructure | None
    criterion: str
    level: float
    fit: Refit | None
    best_fit: Refit | None = None
    pair: tuple[str, str] | None = None
    rival_pairs: tuple[tuple[str, str], ...] = ()
    alone: Candidate | None = None
    passed_over: Mapping[str, str] = field(default_factory=dict)

    @property
    def best(self) -> Candidate | None:
        """The missing effect; None when none is significant."""
        return self.candidates[0] if self.set else None

    @property
    def twins(self) -> tuple[Twins, ...]:
        """Effects that are one equation with the missing one, which no motion tells apart."""
        if self.pair is not None:
            return tuple(group for rung in self.rungs for group in find_twins(self.model, rung.set))
        return find_twins(self.model, self.set, None if self.best is None else self.best.replaces)

    @property
    def rungs(self) -> tuple[Rung, ...]:
        """What a ladder adds, one after the other: nothing, the best effect, or both effects of a pair."""
        if self.best is None:
            return ()
        if self.pair is None or self.alone is None:
            return (Rung(self.best, self.set),)
        first, second = self.pair
        return (
            Rung(self.alone, self.set),
            Rung(self.candidates[1], tied_members(second, first, self.rival_pairs)),
        )

    def or_rather(self, further: Leap) -> Diagnosis:
        """Take what a leap has found instead, where that explains more."""
        if self.best_fit is not None and self.best_fit.log_likelihood >= further.fit.log_likelihood:
            return self
        first, *beside = (rung.added for rung in further.rungs)
        # Each candidate of a pair has the model that has both.
        added = [replace(one, model=beside[-1].model if beside else one.model) for one in (first, *beside)]
        names = {one.name for one in added}
        return replace(
            self,
            candidates=(*added, *(c for c in self.candidates if c.name not in names)),
            set=further.rungs[0].set,
            verdict=MISSING,
            gate=replace(self.gate, findings=tuple(said for said in self.gate.findings if said not in _UNFOLLOWED)),
            unknown=None,
            best_fit=further.fit,
            pair=(first.name, beside[0].name) if beside else None,
            rival_pairs=tuple((first.name, name) for name in further.rungs[-1].set[1:]) if beside else (),
            alone=first if beside else None,
        )

    def why_unmoved(self, setting: Setting, start: Model) -> Diagnosis:
        """Where the model does not follow the command: look whether it follows minus the command, which explains all.

        Parameters
        ----------
        setting : Setting
        start : Model
            As the user gave it.
        """
        told = [said for said in self.gate.findings if said in _UNFOLLOWED]
        if not told or self.fit is None or not reversed_command(setting, self.fit, start):
            return self
        findings = tuple(REVERSED if said in told else said for said in self.gate.findings)
        return replace(
            self, verdict=NOT_EXCITED, gate=replace(self.gate, findings=findings), unknown=None, passed_over={}
        )

    @property
    def untestable(self) -> tuple[str, ...]:
        """Effects that this data cannot show; one that it has shown is none of them, however far it reaches.

        What was significant and passed over has left its trace too: the reason is told, not that it cannot show. Nor is
        what may stand, with another, for the missing one.
        """
        alike = (part for group in self.twins for part in group.parts)
        shown = {*self.set, *(self.pair or ()), *self.passed_over, *alike}
        return tuple(name for name in self.gate.untestable if name not in shown)

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON, schema ``idloop/diagnose/1``."""
        return {
            "schema": "idloop/diagnose/1",
            "model": self.model.name,
            "criterion": self.criterion,
            "level": self.level,
            "verdict": self.verdict,
            "best": None if self.best is None else self.best.name,
            "set": list(self.set),
            "pair": None if self.pair is None else list(self.pair),
            "rival_pairs": [list(names) for names in self.rival_pairs],
            "candidates": [c.to_dict() for c in self.candidates],
            "untestable": list(self.untestable),
            "gate": self.gate.to_dict(),
            "unknown": None if self.unknown is None else self.unknown.to_dict(),
            "passed_over": dict(self.passed_over),
            "one_equation": [group.to_dict() for group in self.twins],
        }

    def summary(self) -> str:
        """The answer in words, several lines."""
        lines = list(self.gate.findings)
        if self.best is not None and self.pair is not None:
            first, second = self.candidates[:2]
            lines.append(
                f"missing: only together: {first.name} and {second.name} (p = {first.p_value:.2g}); "
                f"each hides the other. {first.text} {second.text}"
            )
            if self.rival_pairs:
                lines.append("this data cannot tell them from " + ", ".join(" with ".join(p) for p in self.rival_pairs))
        elif self.best is not None:
            others = [name for name in self.set if name != self.best.name]
            lines.append(f"missing: {self.best.name} (p = {self.best.p_value:.2g}). {self.best.text}")
            if others:
                lines.append(f"this data cannot tell it from {', '.join(others)}")
            lines += [group.text for group in self.twins]
        elif self.unknown is not None:
            lines.append(self.unknown.text)
        elif REVERSED in self.gate.findings or self.verdict == UNKNOWN:
            pass  # the finding says what there is to say
        elif self.verdict == NOT_EXCITED:
            lines.append("nothing significant is left, but this data cannot show " + ", ".join(self.untestable))
        else:
            lines.append("nothing significant is left")
        lines += [f"significant, yet passed over: {name}: {why}" for name, why in self.passed_over.items()]
        return "\n".join(lines)


def diagnose_fitted(
    setting: Setting,
    parent: Refit,
    *,
    level: float,
    effects: Sequence[str] | None = None,
    seed: int = 0,
    progress: Progress | None = None,
    rungs: bool = False,
    held_out: Setting | None = None,
) -> Diagnosis:
    """As `diagnose`, for a model that is fitted already.

    Single effects are tested at four fifths of the level; where none is significant, pairs of effects
    are, at the other fifth (`idloop.diagnose.pairs`). Together the error rate is the level. Pairs are
    for the prediction criterion: by the others single effects have all of it.

    Parameters
    ----------
    setting : Setting
    parent : Refit
    rungs : bool
        Name a plain effect before the richer one that contains it, so that each has to earn its place.
    held_out : Setting, optional
        Validation records, on which an effect must do no harm.
    level, effects, seed, progress
        As in `diagnose`.

    Returns
    -------
    Diagnosis
    """
    tell = progress or (lambda share, text: None)
    open_ = proposals(parent.model, effects)
    screen = Screen(setting, parent, seed)
    screened = screen.all(open_, lambda share, text: tell(0.15 + 0.4 * share, f"screening {text}"))
    null = calibrate(screened, seed + 1)
    share = single_share(setting.kind)
    bar = null.threshold(share * level)
    swallowed = _swallowed(parent)
    # Of what the score test does not hold for significant, a ladder needs no refit, unless the noise model has
    # swallowed what the test looks at.
    chosen = promising(screened, bar, 0) if rungs and not swallowed else promising(screened, null.threshold(0.5))
    chosen += [s for s in _judged_by_refit(screened, parent) if s not in chosen]
    confirmed = confirm(
        setting,
        parent,
        chosen,
        lambda share, text: tell(0.55 + 0.2 * share, f"refitting with {text}"),
        None if swallowed else lambda first: may_decide(first, bar),
    )
    if swallowed and (not confirmed or _swallowed(confirmed[0].fit)):
        confirmed += confirm_behind_noise(
            setting, parent, screened, lambda share, text: tell(0.75 + 0.1 * share, f"looking behind noise: {text}")
        )
        confirmed = list({c.proposal.name: c for c in sorted(confirmed, key=lambda c: c.gain)}.values())
    if confirmed:
        confirmed = beside_the_noise_of(max(confirmed, key=lambda c: c.gain), setting, parent, confirmed)
    if swallowed:
        confirmed = [replace(c, allowance=ALLOWANCE * bar) for c in confirmed]
    parent, confirmed = same_footing(setting, parent, confirmed, bar)
    ranked = rank(parent, confirmed, null, share * level)
    significant, refused, stand_ins = [], {}, False
    testable = [c for c in ranked if p_value_of(null, statistic(c), share) < level]
    left = remaining(screen, level)
    for c in testable:
        if why := at_its_bound(c.fit.model, c.proposal):
            refused[c.proposal.name] = why
        elif why := stands_in(screen, left, c, bar):
            refused[c.proposal.name], stand_ins = why, True
        elif not consistent(parent, c, setting.kind):
            refused[c.proposal.name] = "what it explains is not steady from one stretch of the data to the next"
        elif held_out is not None and not holds(held_out, parent, c):
            refused[c.proposal.name] = "it does harm on the unseen data"
        else:
            significant.append(c)
    moved = follows(setting, parent)
    if not moved:
        refused |= {c.proposal.name: REFUSED for c in significant if not follows(setting, c.fit)}
        significant = [c for c in significant if c.proposal.name not in refused]
    best, slight = _missing(setting, parent, significant, rungs=rungs)
    significant.sort(key=lambda c: c is not best)
    ranked.sort(key=lambda c: c is not best)
    rivals: list[Confirmed] = []
    if best is not None:
        best, rivals = with_rivals(
            setting, parent, best, significant[1:], screened, confirmed, bar=bar, held_out=held_out
        )
        ranked = _with_refits(ranked, best, rivals)
    pair: MissingPair | None = None
    # Two effects stand in for something else as well as one does.
    if best is None and share < 1.0 and not stand_ins and not any(learnt.shape.coefficient for learnt, _ in left):
        pairs = Pairs(screened, seed + 2)
        joined = promising_pairs(screen, screened, pairs, level, bar)
        refitted = confirm_pairs(
            setting, parent, joined, lambda share, text: tell(0.85 + 0.1 * share, f"refitting with {text}")
        )
        before = parent.log_likelihood
        parent, both = same_footing(setting, parent, [p.together for p in refitted], pairs.threshold(level))
        lift = parent.log_likelihood - before
        ranked = [replace(c, gain=max(c.gain - lift, 0.0)) for c in ranked]
        refitted = [replace(p, together=c) for p, c in zip(refitted, both, strict=True)]
        pair = judge_pairs(setting, parent, refitted, pairs, level=level, bar=bar, held_out=held_out)
        if pair is not None and not moved and not follows(setting, pair.best.together.fit):
            pair = None
    gated = gate(parent.model, setting, screened, bar)
    unknown = unknown_structure(screen, left) if best is None and pair is None else None
    otherwise = not moved and best is None and pair is None and foretells(setting.records, seed)
    if otherwise:
        gated = replace(gated, findings=(*gated.findings, OTHERWISE))
    elif not moved and best is None and pair is None:
        gated = replace(gated, findings=(*gated.findings, UNMOVED))
        # A force over the motion says nothing where it is not the command that moves the axis.
        unknown = unknown if unknown is not None and unknown.of_the_drive else None
    candidates = all_candidates(setting, parent, ranked, best, rivals, screened, null, gated, share)
    names = tuple(c.proposal.name for c in ([best, *rivals] if best else []))
    alone = None
    if pair is not None:
        members = pair_candidates(setting, parent, pair, gated)
        named = {c.name for c in members}
        candidates = (*members, *(c for c in candidates if c.name not in named))
        names = pair.ties(0)
        model = with_stderr(pair.alone, setting.records)
        alone = replace(members[0], model=model, parameters=effect_parameters(model, members[0].name))
    verdict = MISSING if names else UNKNOWN if unknown or otherwise else ADEQUATE
    if verdict == ADEQUATE and (gated.poor or not moved):
        verdict = NOT_EXCITED
    over = {**refused, **slight}
    if best is not None:
        # What may stand, with another, for the missing effect is not passed over.
        for part in {part for group in find_twins(parent.model, names, best.proposal.replaces) for part in group.parts}:
            over.pop(part, None)
    tell(1.0, "done")
    return Diagnosis(
        model=parent.model,
        candidates=candidates,
        set=names,
        verdict=verdict,
        gate=gated,
        unknown=unknown,
        criterion=setting.kind,
        level=level,
        fit=parent,
        best_fit=best.fit if best else pair.best.together.fit if pair else None,
        pair=pair.best.names if pair else None,
        rival_pairs=tuple(p.names for p in pair.rivals) if pair else (),
        alone=alone,
        passed_over=over,
    )


def _swallowed(fit: Refit) -> bool:
    """Whether the noise model explains what no noise would.

    A free whitening imitates a filter, a resonance or a sensor's error so well that its innovations show
    no effect any more. Noise of few lags is taken for noise.
    """
    if not isinstance(fit.criterion, InnovationCriterion):
        return False
    if fit.coloured <= MUCH_COLOUR or fit.coloured > ANY_COLOUR:
        return fit.coloured > ANY_COLOUR
    return max(choose_order(group) for group in fit.problem.errors(fit.point)) >= MANY_LAGS


def _judged_by_refit(screened: list[Screened], parent: Refit) -> list[Screened]:
    """Effects of which a score says little.

    Slow forces that a long memory of the noise may stand for (of those that act on bodies alike, on the
    first), and effects that would take a plainer one's place.
    """
    criterion = parent.criterion
    if not isinstance(criterion, InnovationCriterion):
        return []
    remembers = criterion.memory >= LONG_MEMORY or any(parent.problem.orders)
    places = ("input", parent.model.bodies[0])

    def slow(proposal: Proposal) -> bool:
        alike = proposal.effect.name != "viscous_friction"
        return remembers and proposal.effect.slow and (proposal.at in places or not alike)

    return [s for s in screened if s.traces and (s.proposal.replaces is not None or slow(s.proposal))]


def _missing(
    setting: Setting, parent: Refit, significant: list[Confirmed], *, rungs: bool
) -> tuple[Confirmed | None, dict[str, str]]:
    """The best of the significant effects, or the plainest, and why those before it are too slight.

    They leave the list.
    """
    slight: dict[str, str] = {}
    while significant:
        best, plain = significant[0], _plainest(significant)
        if setting.kind != "prediction":
            return (plain if rungs else best), slight
        if plain is not best and (
            rungs
            # What the richer one has beyond the plain one must have shown.
            or not distinguishable(best.fit, plain.fit)
            or same_motion(best.fit.model, plain.fit.model, setting.records)
        ):
            best = plain
        why = too_slight(parent, best, setting.records)
        if not why:
            return best, slight
        slight[best.proposal.name] = why
        significant.remove(best)
    return None, slight


def _with_refits(ranked: list[Confirmed], best: Confirmed, rivals: list[Confirmed]) -> list[Confirmed]:
    """The best, the fits of rivals that the list has not, or has worse ones of, and the list."""
    latest = {c.proposal.name: c for c in rivals}
    listed = [latest.pop(c.proposal.name, c) for c in ranked if c.proposal.name != best.proposal.name]
    return [best, *latest.values(), *listed]


def _plainest(significant: list[Confirmed]) -> Confirmed:
    """The best effect, or a significant plainer one that it contains."""
    best = significant[0]
    rich = best.proposal.effect
    for c in significant[1:]:
        name = c.proposal.effect.name
        if (name in rich.contains and c.proposal.at == best.proposal.at) or name in rich.degenerates_to:
            return c
    return best
