"""Expected outcome of an experiment, in numbers and sentences."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from idloop.diagnosis.design.rival_set import nested
from idloop.spelling import joined_names
from idloop.validation.words import short

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from idloop.diagnosis.design.experiment import Experiment
    from idloop.diagnosis.design.limits import Limits
    from idloop.diagnosis.design.rivals import Rival

# Expected log-likelihood difference above which an experiment is expected to decide.
DECISIVE = 10.0


@dataclass(frozen=True)
class Outcome:
    """What to expect if one rival is right.

    Attributes
    ----------
    rival : str
        What sets it apart.
    in_favour : float
        Expected log-likelihood by which it leads the closest other one.
    closest : str
        That other one.
    errors : dict
        For every other rival that does not contain this one, refitted to this experiment too, the root mean
        square by which its outputs differ: ``{rival: {output: {"value": 0.1, "unit": "rad", "noise": 0.001}}}``.
    text : str
        One sentence.
    """

    rival: str
    in_favour: float
    closest: str
    errors: dict[str, dict[str, dict[str, Any]]]
    text: str

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return asdict(self)


def outcomes_of(
    rivals: Sequence[Rival], experiment: Experiment, gains: NDArray[np.float64], *, against_first: bool = False
) -> tuple[Outcome, ...]:
    """Expected outcome for each rival as the truth; `gains` (m, m) are from `experiment_gains`."""
    outcomes = []
    inside = nested([rival.model for rival in rivals])
    for i, truth in enumerate(rivals):
        record = experiment.run(truth.model, engine=truth.engine)
        own = truth.errors(record, experiment.start)
        others = [j for j in range(len(rivals)) if j != i and (j == 0 or i == 0 or not against_first)]
        errors = {}
        for other in (rivals[j] for j in others if not inside[i, j]):
            theta = other.expected_loss(record, experiment.start, own, searched=True).theta
            errors[other.label] = other.view.differences(record, experiment.start, theta, experiment)
        open_ = [j for j in others if not inside[i, j]]
        closest = min(open_ or others, key=lambda j: float(gains[i, j]))
        label = rivals[closest].label
        outcomes.append(
            Outcome(
                truth.label, float(gains[i, closest]), label, errors,
                _sentence(truth.label, label, float(gains[i, closest]), errors.get(label)),
            )
        )  # fmt: skip
    return tuple(outcomes)


def _sentence(truth: str, other: str, gain: float, errors: Mapping[str, Mapping[str, Any]] | None) -> str:
    if errors is None:
        return f"if {truth}: {other} contains it and fits as well, with nothing left for what it adds"
    name, worst = max(errors.items(), key=lambda item: item[1]["value"] / max(item[1]["noise"], 1e-300))
    if gain < 1.0:
        return f"if {truth}: {other} fits as well, so that this experiment cannot tell"
    return (
        f"if {truth}: {other}, refitted, misses {name} by {worst['value']:.3g} {worst['unit']} RMS "
        f"(noise {worst['noise']:.2g}) and loses by {lead_text(gain)} in log-likelihood"
    )


def describe(
    rivals: Sequence[Rival], experiment: Experiment, limits: Limits, score: float, gains: NDArray[np.float64]
) -> str:
    """What the experiment is expected to decide, in one or two sentences.

    `score` is the expected lead for the pair that is hardest to tell apart, `gains` (m, m) are from `experiment_gains`.
    """
    names = " and ".join(rival.label for rival in rivals) if len(rivals) == 2 else f"{len(rivals)} rivals"
    if score >= DECISIVE:
        return f"expected to tell {names} apart: the right one wins by about {lead_text(score)} in log-likelihood"
    model = rivals[0].model
    bounds = []
    if limits.command is not None:
        bounds.append(f"command up to {limits.command:.3g} {model.input.unit}")
    unit = model.units.position
    if limits.position is not None:
        bounds.append(f"position {short(limits.position[0])} to {short(limits.position[1])} {unit}")
    if limits.velocity is not None:
        bounds.append(f"velocity up to {limits.velocity:.3g} {unit}/s")
    none = (
        f"no experiment of {experiment.duration:.3g} s within these limits ({', '.join(bounds) or 'none'}) is expected"
    )
    best = f"(at best {lead_text(score)} in log-likelihood)"
    pairs = list(itertools.combinations(range(len(rivals)), 2))
    separated = sum(min(gains[i, j], gains[j, i]) >= DECISIVE for i, j in pairs)
    if separated:
        these = joined_names([rival.label for rival in rivals])
        return f"expected to tell {separated} of the {len(pairs)} pairs of {these} apart; {none} to tell all {best}"
    return f"{none} to tell {names} apart {best}: widen them"


def describe_visible(outcomes: Sequence[Outcome]) -> str:
    """Which effects an experiment is expected to show, and which it will not, within the limits."""
    seen = [outcome.rival for outcome in outcomes[1:] if outcome.in_favour >= DECISIVE]
    unseen = [outcome.rival for outcome in outcomes[1:] if outcome.in_favour < DECISIVE]
    if not seen:
        return f"no experiment within these limits is expected to show {joined_names(unseen)}: widen them"
    tail = f"; not {joined_names(unseen)}, which needs wider limits" if unseen else ""
    return f"expected to show {joined_names(seen)} if there{tail}"


def describe_signal(signal: Mapping[str, Any], adds_to: str, unit: str = "") -> str:
    """One line with the kind, the size and the length of a signal, by the arguments of `build_signal`."""
    from idloop.signals import SIGNALS

    units = {spec.name: spec.unit for spec in SIGNALS[signal["name"]].parameters}
    per_second = {"velocity_limit": f"{unit}/s", "acceleration_limit": f"{unit}/s²"} if unit else {}
    unit_of = units | {"amplitude": unit, "offset": unit} | per_second
    parts = [f"{signal['name'].replace('_', ' ')} on the {adds_to}", f"{signal['duration']:g} s"]
    for key, value in signal.items():
        if key in {"name", "sample_time", "duration", "seed", "ramp_in"} or (key == "offset" and not value):
            continue
        parts.append(f"{key.replace('_', ' ')} {_short(value)} {unit_of.get(key) or ''}".rstrip())
    return ", ".join(parts)


def _short(value: Any) -> str:
    if isinstance(value, list | tuple):
        return "[" + " ".join(_short(item) for item in value) + "]"
    return f"{value:g}" if isinstance(value, float) else str(value)


def lead_text(gain: float) -> str:
    """Text of a log-likelihood with its significant digits."""
    return f"{gain:.1f}" if gain < DECISIVE else f"{float(f'{gain:.2g}'):.0f}"
