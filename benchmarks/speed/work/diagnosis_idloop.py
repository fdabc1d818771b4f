"""Diagnosis and ladder by idloop, on a case of the diagnosis suite made as long as wanted."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
sys.path.insert(0, str(Path(__file__).resolve().parents[3] / "examples"))
sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "diagnosis"))

from cases import cases_of
from diagnosis_time import longer
from experiment import experiment

from idloop.diagnosis import diagnose, refine


def work(data: dict[str, Any], settings: dict[str, Any]) -> Callable[[], dict[str, Any]]:
    """One recording at 1 kHz with the effects of the case hidden in it."""
    (case,) = cases_of(settings["case"].__eq__)
    made = experiment(longer(case, float(data["seconds"][0]), hidden=True))

    def ladder() -> dict[str, Any]:
        found = refine(made.start, made.training)
        added = [step.added for step in found.steps if step.added is not None]
        hidden = {effect.effect for effect in case.hidden}
        return {"steps": len(added), "right": sum(one.effect in hidden for one in added)}

    def one() -> dict[str, Any]:
        found = diagnose(made.start, made.training)
        hidden = {effect.effect for effect in case.hidden}
        return {"right": float(any(name.partition("@")[0] in hidden for name in found.set))}

    return ladder if settings["ladder"] else one


def shorter(data: dict[str, Any]) -> dict[str, Any]:
    """A few seconds, for compilation."""
    return {"seconds": data["seconds"] * 0.0 + 5.0}
