"""The next experiment in words: what it sends, what it is expected to decide, what each rival would show."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from idloop.diagnosis.design.expected_outcome import DECISIVE, describe_signal, lead_text
from idloop.reporting.text.blocks import Block, Table


def experiment_blocks(suggested: Mapping[str, Any]) -> Iterator[Block]:
    """Yield what an experiment is expected to decide, and a row for each rival.

    `suggested`: as `idloop.diagnosis.design.suggest.Suggestion.to_dict` writes it, or what is left of it in a ladder.
    """
    if suggested.get("signal"):
        signal = describe_signal(suggested["signal"], suggested["adds_to"], suggested.get("unit", ""))
        yield f"next experiment: {signal}"
    yield suggested["text"]
    if suggested.get("outcomes"):
        yield _outcomes(suggested["outcomes"])
        yield f"(lead: expected difference in log-likelihood from the other, refitted; {DECISIVE:.0f} or more decides)"


def _outcomes(outcomes: Sequence[Mapping[str, Any]]) -> Table:
    rows = []
    for one in outcomes:
        errors: Mapping[str, Mapping[str, Any]] | None = one["errors"].get(one["closest"])
        shown = "none: it contains this one"
        if errors:
            name, worst = max(errors.items(), key=lambda item: item[1]["value"] / max(item[1]["noise"], 1e-300))
            shown = f"{worst['value']:.3g} {worst['unit']} of {name}, noise {worst['noise']:.2g}"
        decides = "yes" if errors and one["in_favour"] >= DECISIVE else "no"
        rows.append((one["rival"], one["closest"], shown, lead_text(one["in_favour"]), decides))
    return Table.of(("if this is right", "closest other", "largest difference, RMS", "lead", "decides"), rows)
