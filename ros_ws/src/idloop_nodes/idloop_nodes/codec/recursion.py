"""Coefficients of the recursive black-box model as diagnostic statuses and back, without loss."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from idloop.records.bags.cdr import CdrError
from idloop_nodes.codec.diagnostics import Level, Status
from idloop_nodes.codec.numbers import plus_minus


@dataclass(frozen=True)
class RecursionSummary:
    """What a recursive method has made of one output so far.

    Attributes
    ----------
    output : str
        As "motor.position".
    unit : str
        Of the output.
    method : str
        As the parameter `recursion` has it.
    samples : int
        Measurements that it has learnt from.
    innovation_std : float
        Standard deviation of the innovations [output unit].
    coefficients : dict of str to tuple of float
        Value and standard error by name, as "a1".
    """

    output: str
    unit: str
    method: str
    samples: int
    innovation_std: float
    coefficients: dict[str, tuple[float, float]]


def recursion_to_statuses(node: str, summaries: Sequence[RecursionSummary]) -> list[Status]:
    """Return the statuses of ``estimator/coefficients``, one for each output."""
    statuses = []
    for one in summaries:
        values = {
            "output": one.output,
            "unit": one.unit,
            "method": one.method,
            "samples": str(one.samples),
            "innovation_std": repr(float(one.innovation_std)),
        }
        for name, (value, stderr) in one.coefficients.items():
            values[f"value/{name}"] = repr(float(value))
            values[f"stderr/{name}"] = repr(float(stderr))
        text = ", ".join(
            f"{name} = {value:.4g}{plus_minus(stderr, 1)}" for name, (value, stderr) in one.coefficients.items()
        )
        message = f"{one.method} after {one.samples} samples: {text}"
        statuses.append(Status(f"{node}: {one.output}", message, Level.OK, values, one.output))
    return statuses


def recursion_from_statuses(statuses: Sequence[Status]) -> list[RecursionSummary]:
    """Return the summaries that `recursion_to_statuses` wrote.

    Raises
    ------
    CdrError
        When a value is missing or no number.
    """
    try:
        return [_summary(status.values) for status in statuses]
    except (KeyError, ValueError) as error:
        raise CdrError(f"estimator/coefficients cannot be read: {error}") from error


def _summary(values: dict[str, str]) -> RecursionSummary:
    names = [key.removeprefix("value/") for key in values if key.startswith("value/")]
    return RecursionSummary(
        output=values["output"],
        unit=values["unit"],
        method=values["method"],
        samples=int(values["samples"]),
        innovation_std=float(values["innovation_std"]),
        coefficients={name: (float(values[f"value/{name}"]), float(values[f"stderr/{name}"])) for name in names},
    )
