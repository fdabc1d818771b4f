"""The result as Markdown for readers and as JSON for programs."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from speed.result import Claim, Row, Section


def duration(seconds: float | None) -> str:
    """Three digits, in the unit that suits."""
    if seconds is None:
        return "–"
    scales = ((1.0, "s"), (1e3, "ms"), (1e6, "µs"))
    factor, unit = next((scale for scale in scales if seconds * scale[0] >= 1.0), scales[-1])
    return f"{digits(seconds * factor)} {unit}"


def markdown(sections: Sequence[Section], about: dict[str, Any]) -> str:
    """All sections: what was measured beside each other, and targets with what was reached."""
    text = [f"Measured {about['when']} on {about['machine']}; load {about['load']}; {about['clock']} time.", ""]
    for section in sections:
        text += [f"## {section.title}", "", *_rows(section), "", *_claims(section.claims), ""]
        text += [line for remark in section.remarks for line in (remark, "")]
    return "\n".join(text)


def write(sections: Sequence[Section], about: dict[str, Any], folder: Path) -> None:
    """Write ``benchmark.md`` and ``benchmark.json``."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "benchmark.md").write_text(markdown(sections, about), encoding="utf-8")
    claims = [[asdict(claim) | {"met": claim.met} for claim in section.claims] for section in sections]
    documents = [asdict(section) | {"claims": own} for section, own in zip(sections, claims, strict=True)]
    document = {"schema": "idloop/benchmark/1", **about, "sections": documents}
    (folder / "benchmark.json").write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")


def _rows(section: Section) -> list[str]:
    memory = any(row.memory is not None for row in section.rows)
    head = ["work", "", "time", "beside ours", *(["memory"] if memory else []), "answer"]
    lines = [f"| {' | '.join(head)} |", "|" + "---|" * len(head)]
    last = ""
    for row in section.rows:
        size = "–" if row.memory is None else f"{row.memory:.0f} MB"
        cells = [row.work if row.work != last else "", row.who, _time(row), _beside(section, row)]
        cells += [*([size] if memory else []), _answer(row)]
        lines.append(f"| {' | '.join(cells)} |")
        last = row.work
    return lines


def _time(row: Row) -> str:
    return row.note if row.seconds is None else duration(row.seconds)


def _beside(section: Section, row: Row) -> str:
    ratio = section.ratio(row.work, row.who)
    if ratio is None:
        return "–"
    return "1" if row.who == "idloop" else digits(ratio)


def _answer(row: Row) -> str:
    parts = [f"{name} {digits(value)}" for name, value in row.answer.items()]
    if row.agrees is False:
        parts.append("**does not agree**")
    if row.note and row.seconds is not None:
        parts.append(row.note)
    return ", ".join(parts) or "–"


def _claims(claims: Sequence[Claim]) -> list[str]:
    if not claims:
        return []
    lines = ["| target | | reached | |", "|---|---|---|---|"]
    for claim in claims:
        sign = "≥" if claim.at_least else "≤"
        reached = "–" if claim.reached is None else f"{digits(claim.reached)} {claim.unit}"
        verdict = {True: "yes", False: "**no**" + (f": {claim.limit}" if claim.limit else ""), None: "not measured"}
        lines.append(f"| {claim.text} | {sign} {claim.target:g} {claim.unit} | {reached} | {verdict[claim.met]} |")
    return lines


def digits(value: float) -> str:
    """Three digits, or the power of ten of what is very small or large."""
    if value != 0.0 and (abs(value) < 1e-3 or abs(value) >= 1e6):
        return f"{value:.1e}"
    return f"{value:.0f}" if abs(value) >= 100.0 else f"{value:.3g}"
