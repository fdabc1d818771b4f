"""A suggested experiment with its rivals as a document, so that a report can draw it again."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from idloop.diagnosis.design.suggest import Suggestion

SCHEMA = "idloop/next/1"


def next_document(suggestion: Suggestion) -> dict[str, Any]:
    """Plain values for JSON.

    Returns: schema ``idloop/next/1``: what ``ladder.json`` says of it, and what its simulation needs.
    """
    return {
        "schema": SCHEMA,
        **suggestion.to_dict(),
        "controller": suggestion.controller,
        "sample_time": suggestion.sample_time,
        "noise": list(suggestion.noise),
        "against_first": suggestion.against_first,
        "rivals": [{"label": label, "model": model.to_yaml()} for label, model in suggestion.rivals],
    }


def read_next(document: dict[str, Any], folder: Path | None = None) -> Suggestion:
    """Read what `next_document` wrote.

    `folder`: where the models' own effects lie.
    """
    from idloop.diagnosis.design.suggest import Limits, Outcome, Suggestion
    from idloop.physics.model_file import from_text

    limits = document["limits"]
    reach = limits.get("position")
    return Suggestion(
        signal=document["signal"],
        adds_to=document["adds_to"],
        duration=document["duration"],
        discrimination=document["discrimination"],
        outcomes=tuple(Outcome(**outcome) for outcome in document["outcomes"]),
        text=document["text"],
        limits=Limits(**{**limits, "position": None if reach is None else (float(reach[0]), float(reach[1]))}),
        start=document["start"],
        controller=document["controller"],
        sample_time=document["sample_time"],
        rivals=tuple((rival["label"], from_text(rival["model"], folder)) for rival in document["rivals"]),
        noise=tuple(document["noise"]),
        against_first=document["against_first"],
    )


def experiment_text(suggested: Mapping[str, Any]) -> str:
    """YAML that the excitation node takes as its parameter `experiment`, with what to know as comments."""
    import io

    from ruamel.yaml import YAML

    lines = [f"# {suggested['text']}"] + [f"# {outcome['text']}" for outcome in suggested.get("outcomes", ())]
    lines.append(f"# starts at rest at position {suggested.get('start', 0.0):.6g}; lasts {suggested['duration']:g} s")
    buffer = io.StringIO()
    plain = {
        key: list(value) if isinstance(value, list | tuple) else value for key, value in suggested["signal"].items()
    }
    YAML().dump({"signal": plain, "adds_to": suggested["adds_to"]}, buffer)
    return "\n".join(lines) + "\n" + buffer.getvalue()
