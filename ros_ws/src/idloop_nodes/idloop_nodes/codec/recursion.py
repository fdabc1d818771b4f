"""Coefficients of the recursive black-box model as diagnostic statuses and back, without loss."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from idloop_nodes.codec.diagnostics import Level, Status
from idloop_nodes.codec.key_values import from_values, reading, to_values
from idloop_nodes.codec.numbers import plus_minus


@dataclass(frozen=True)
class RecursionSummary:
    """Estimate of a recursive method for one output."""

    output: str  # as "motor.position"
    unit: str  # of the output
    method: str  # as the parameter `recursion` has it
    samples: int  # measurements that were used
    innovation_std: float  # standard deviation of the innovations [output unit]
    coefficients: dict[str, tuple[float, float]]  # value and standard error by name, as "a1"


def recursion_to_statuses(node: str, summaries: Sequence[RecursionSummary]) -> list[Status]:
    """Return the statuses of ``estimator/coefficients``, one for each output."""
    statuses = []
    for one in summaries:
        values = to_values(one)
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
    """Return the summaries that `recursion_to_statuses` wrote; CdrError when one cannot be read."""
    if not statuses:
        return []
    with reading("estimator/coefficients", statuses):
        return [_summary(status.values) for status in statuses]


def _summary(values: dict[str, str]) -> RecursionSummary:
    names = [key.removeprefix("value/") for key in values if key.startswith("value/")]
    coefficients = {name: (float(values[f"value/{name}"]), float(values[f"stderr/{name}"])) for name in names}
    return from_values(RecursionSummary, values, coefficients=coefficients)
