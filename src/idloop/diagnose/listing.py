"""All effects that a diagnosis has weighed, as it shows them."""

from __future__ import annotations

from idloop.diagnose.calibrate import Null
from idloop.diagnose.candidate import Candidate, effect_parameters
from idloop.diagnose.confirm import Confirmed
from idloop.diagnose.evidence import explained, statistic
from idloop.diagnose.gate import Gate
from idloop.diagnose.intervals import with_stderr
from idloop.diagnose.pairs import MissingPair
from idloop.diagnose.refit import Refit
from idloop.diagnose.screen import Screened
from idloop.diagnose.setting import Setting


def p_value_of(null: Null, value: float, share: float) -> float:
    """Family-wise p-value of a statistic.

    Parameters
    ----------
    null : Null
    value : float
        Statistic.
    share : float
        Of the error rate, that single effects have: the p-value is divided by it.
    """
    return min(null.p_value(value) / share, 1.0)


def all_candidates(
    setting: Setting,
    parent: Refit,
    ranked: list[Confirmed],
    best: Confirmed | None,
    rivals: list[Confirmed],
    screened: list[Screened],
    null: Null,
    gated: Gate,
    share: float,
) -> tuple[Candidate, ...]:
    """List what was refitted, then what was screened only, best first.

    Parameters
    ----------
    setting : Setting
    parent : Refit
        Without any of them.
    ranked : list of Confirmed
        What was refitted, best first.
    best : Confirmed or None
        The missing effect.
    rivals : list of Confirmed
        What the data cannot tell from it.
    screened : list of Screened
        All effects.
    null : Null
    gated : Gate
    share : float
        As in `p_value_of`.

    Returns
    -------
    tuple of Candidate
        The best and its rivals with standard errors; without a best the first one.
    """
    found = []
    precise = {id(c) for c in ([best, *rivals] if best else ranked[:1])}
    for c in ranked:
        name = c.proposal.name
        model = with_stderr(c.fit, setting.records) if id(c) in precise else c.fit.model
        found.append(
            Candidate(
                effect=c.proposal.effect.name,
                at=c.proposal.at,
                testable=gated.testable.get(name, "yes"),
                why=gated.why.get(name, ""),
                text=c.proposal.effect.text,
                gain=c.gain,
                p_value=p_value_of(null, statistic(c), share),
                explains=explained(parent, c.fit),
                parameters=effect_parameters(model, name),
                model=model,
                replaces=c.proposal.replaces,
            )
        )
    done = {c.name for c in found}
    rest = sorted((s for s in screened if s.proposal.name not in done), key=lambda s: -s.statistic)
    for s in rest:
        name = s.proposal.name
        found.append(
            Candidate(
                effect=s.proposal.effect.name,
                at=s.proposal.at,
                testable=gated.testable.get(name, "yes"),
                why=gated.why.get(name, ""),
                text=s.proposal.effect.text,
                p_value=max(p_value_of(null, s.statistic, share), 1e-300) if not best else 1.0,
                replaces=s.proposal.replaces,
            )
        )
    return tuple(found)


def pair_candidates(setting: Setting, parent: Refit, found: MissingPair, gated: Gate) -> tuple[Candidate, ...]:
    """List both effects of the missing pair, then those of its rivals, all with the evidence of their pair.

    Parameters
    ----------
    setting : Setting
    parent : Refit
    found : MissingPair
    gated : Gate
    """
    members: dict[str, Candidate] = {}
    for pair in (found.best, *found.rivals):
        fit = pair.together.fit
        model = with_stderr(fit, setting.records)
        for proposal, other in ((pair.first, pair.second), (pair.second, pair.first)):
            if proposal.name not in members:
                members[proposal.name] = Candidate(
                    effect=proposal.effect.name,
                    at=proposal.at,
                    testable=gated.testable.get(proposal.name, "yes"),
                    why=f"it shows together with {other.name} only",
                    text=proposal.effect.text,
                    gain=pair.together.gain,
                    p_value=found.p_values[pair.names],
                    explains=explained(parent, fit),
                    parameters=effect_parameters(model, proposal.name),
                    model=model,
                    replaces=proposal.replaces,
                )
    return tuple(members.values())
