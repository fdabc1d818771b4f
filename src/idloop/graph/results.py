"""What a recorded live estimator found: the newest fit and its parameters, without ROS."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from idloop.graph.diagnostics import Statuses, read_diagnostics, unreadable


@dataclass(frozen=True)
class LiveResult:
    """The last result of a run.

    Attributes
    ----------
    fit : dict
        FIT per output in percent, on samples that the fit did not use.
    fit_train : dict
        FIT per output in percent, on the samples that it used.
    parameters : dict
        By name: value, stderr (or None), unit; where the estimator said so, whether it may be ``trusted`` and ``why``.
    fits : int
        How many fits there were.
    error : str
        Why the last fit failed; empty when it did not.
    """

    fit: dict[str, float] = field(default_factory=dict)
    fit_train: dict[str, float] = field(default_factory=dict)
    parameters: dict[str, dict[str, Any]] = field(default_factory=dict)
    fits: int = 0
    error: str = ""


def read_results(bag: Path) -> LiveResult:
    """Read the estimator's last result from a bag.

    Raises
    ------
    IdloopError
        When the bag cannot be read.
    """
    newest: dict[str, Statuses] = {}
    fits = 0
    for name, statuses in read_diagnostics(bag, ("fit", "parameters")):
        newest[name] = statuses
        fits += name == "fit"
    if "fit" not in newest:
        return LiveResult()
    parameters: dict[str, dict[str, Any]] = {}
    try:
        values, *_ = newest["fit"]
        for one in newest.get("parameters", ()):
            stderr = float(one["stderr"]) if one["stderr"] else None
            parameters[one["parameter"]] = {"value": float(one["value"]), "stderr": stderr, "unit": one["unit"]}
            if one.get("why"):
                parameters[one["parameter"]] |= {"trusted": one["trusted"] == "true", "why": one["why"]}
        return LiveResult(
            fit=_numbers(values, "fit/"),
            fit_train=_numbers(values, "train/"),
            parameters=parameters,
            fits=fits,
            error=values["error"],
        )
    except (KeyError, ValueError) as error:
        raise unreadable(bag, error) from error


def _numbers(values: dict[str, str], prefix: str) -> dict[str, float]:
    return {key.removeprefix(prefix): float(value) for key, value in values.items() if key.startswith(prefix)}
