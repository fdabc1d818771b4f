"""What a recorded live estimator found missing: diagnoses, experiments and the ladder, without ROS."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from idloop.documents import read_json
from idloop.errors import InputError
from idloop.graph.diagnostics import read_diagnostics, unreadable


@dataclass(frozen=True)
class Findings:
    """Everything that the estimator said about missing effects, in its order.

    Attributes
    ----------
    diagnoses : tuple of dict
        Documents of schema idloop/diagnose/1, each with ``where`` (lines) and ``windows`` (first and last stamp
        of each stretch of data in nanoseconds); ``error`` where there was none.
    experiments : tuple of dict
        Experiments that were suggested, as `idloop suggest` writes them.
    ladder : dict or None
        The newest ladder, schema idloop/refine/1.
    evidence : tuple of dict
        Every look at the evidence, schema idloop/live_evidence/1.
    """

    diagnoses: tuple[dict[str, Any], ...] = ()
    experiments: tuple[dict[str, Any], ...] = ()
    ladder: dict[str, Any] | None = None
    evidence: tuple[dict[str, Any], ...] = ()


def read_findings(bag: Path) -> Findings:
    """Read what a live estimator found from a bag.

    Raises
    ------
    IdloopError
        When the bag cannot be read.
    """
    diagnoses: list[dict[str, Any]] = []
    experiments: list[dict[str, Any]] = []
    evidence: list[dict[str, Any]] = []
    ladder: dict[str, Any] | None = None
    try:
        for name, (values, *_) in read_diagnostics(bag, ("missing_effects", "ladder", "evidence")):
            if name == "evidence":
                evidence.append(read_json(values["document"], "evidence"))
            elif name == "missing_effects":
                diagnoses.append(_diagnosis(values))
            elif values["document"]:
                ladder = read_json(values["document"], "ladder")
                suggested = ladder["suggested_experiment"] if ladder else None
                if suggested is not None and suggested not in experiments[-1:]:
                    experiments.append(suggested)
    except (KeyError, ValueError, InputError) as error:
        raise unreadable(bag, error) from error
    return Findings(tuple(diagnoses), tuple(experiments), ladder, tuple(evidence))


def _diagnosis(values: dict[str, str]) -> dict[str, Any]:
    document: dict[str, Any] = {"error": values["error"]}
    if values["document"]:
        document = read_json(values["document"], "missing_effects")
    windows = [[int(stamp) for stamp in one.split("-")] for one in values["windows"].split()]
    return document | {"where": read_json(values["where"], "missing_effects"), "windows": windows}
