"""Candidates: effects that may be missing, with their evidence."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, fields, replace
from typing import Any

import numpy as np

from idloop.diagnosis.evidence.predictive import Course
from idloop.physics.model import Model, effect_name


@dataclass(frozen=True)
class Candidate:
    """One effect at one site, as a diagnosis has evaluated it.

    Attributes
    ----------
    effect, at : str
        Name and site.
    testable : {"yes", "weak", "no"}
        Whether this data could show it.
    why : str
        Why it is testable or not.
    text : str
        The effect in one sentence of physics.
    gain : float
        Log-likelihood gained by the refit; NaN when it was only screened.
    p_value : float
        Probability that the best effect of the catalogue does as well by chance (family-wise).
    explains : float
        Share of the power of the unexplained error that it explains, 0 to 1.
    parameters : dict
        ``{name: {"value": ..., "stderr": ..., "unit": ..., "held": ...}}``; held at its value, not estimated.
    model : Model or None
        The model with the effect fitted; None when it was only screened.
    replaces : str or None
        An effect of the model that it contains and replaces.
    number : int
        Which one it is of an effect that may act several times at a site.
    course : Course or None
        How the evidence has grown over the data; None when it was only screened.
    """

    effect: str
    at: str
    testable: str
    why: str
    text: str
    gain: float = float("nan")
    p_value: float = 1.0
    explains: float = 0.0
    parameters: dict[str, dict[str, Any]] = field(default_factory=dict)
    model: Model | None = None
    replaces: str | None = None
    number: int = 1
    course: Course | None = None

    @property
    def name(self) -> str:
        """Name in the model that has it, such as ``effect@site``."""
        return effect_name(self.effect, self.at, self.number)

    def with_model(self, model: Model) -> Candidate:
        """The candidate with another fit of the model that has it."""
        return replace(self, model=model, parameters=effect_parameters(model, self.name))

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        keys = (
            "effect",
            "at",
            "p_value",
            "explains",
            "testable",
            "gain",
            "parameters",
            "replaces",
            "number",
            "text",
            "why",
        )
        course = None if self.course is None else asdict(self.course)
        found = {name: getattr(self, name) for name in keys} | {"course": course}
        return found | ({"gain": None} if np.isnan(self.gain) else {})

    @classmethod
    def from_dict(cls, document: dict[str, Any]) -> Candidate:
        """Read what `to_dict` wrote; the model is not part of it."""
        known = {one.name for one in fields(cls)} - {"model"}
        own = {"testable": "yes", "why": "", "text": ""} | {k: v for k, v in document.items() if k in known}
        course = own.get("course")
        own["course"] = None if course is None else Course(tuple(course["samples"]), tuple(course["log_e"]))
        return cls(**own | {"gain": float("nan") if own.get("gain") is None else own["gain"]})


@dataclass(frozen=True)
class Rung:
    """One effect that a ladder adds, and those that tie with it, itself first."""

    added: Candidate
    set: tuple[str, ...]


def effect_parameters(model: Model, name: str) -> dict[str, dict[str, Any]]:
    """Value, standard error and unit of every parameter of one effect of a model, and whether it is held.

    An integer that a search has chosen counts as estimated, as does a resolution that is read off the data.
    """
    prefix = f"{name}."
    chosen = {
        p.name for active in model.effects if active.name == name for p in active.effect.parameters
        if p.integer or active.effect.final
    }  # fmt: skip
    return {
        own: {"value": p.value, "stderr": p.stderr, "unit": p.unit, "held": not (p.free or own in chosen)}
        for p in model.parameters
        if p.name.startswith(prefix)
        for own in [p.name[len(prefix) :]]
    }
