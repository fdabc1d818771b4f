"""Fit and parameters as diagnostic statuses and back: for a person one decimal, full in the values."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from idloop.records.bags.cdr import CdrError
from idloop_nodes.codec.diagnostics import Level, Status
from idloop_nodes.codec.key_values import from_values, plus_minus, reading, to_values


@dataclass(frozen=True)
class FitSummary:
    """What one fit on a window is worth on the samples after it."""

    model: str  # name of the model
    effects: tuple[str, ...] = ()  # effects in the model, ``name@site``
    criterion: str = ""  # what was minimised
    # First and last stamp in nanoseconds
    fit_window: tuple[int, int] = (0, 0)
    validation_window: tuple[int, int] = (0, 0)
    # FIT per output in percent on the validation window, which the fit never saw
    fit: dict[str, float] = field(default_factory=dict)
    # FIT per output in percent on the fit window
    fit_train: dict[str, float] = field(default_factory=dict, metadata={"key": "train"})
    loss: float = float("nan")  # loss of the fit
    # By output, p-value of the whiteness test of the free-run residual on the validation window
    whiteness: dict[str, float] = field(default_factory=dict, metadata={"key": "white"})
    error: str = ""  # why there is no fit, one line; empty when there is one
    # By output, rms error of the free run on the validation window over the sensor's noise
    missed: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class ParameterSummary:
    """One parameter of a fitted model: value, standard error, unit, bounds; whether it may be trusted, and why."""

    name: str = field(metadata={"key": "parameter"})
    value: float
    stderr: float | None = None
    unit: str = ""
    minimum: float | None = field(default=None, metadata={"key": "min"})
    maximum: float | None = field(default=None, metadata={"key": "max"})
    free: bool = True
    trusted: bool = field(default=False, metadata={"added": True})
    why: str = field(default="", metadata={"added": True})

    @property
    def at_bound(self) -> bool:
        """Whether an estimated value lies on one of its bounds."""
        return self.free and self.value in (self.minimum, self.maximum)

    @property
    def line(self) -> str:
        """Value and 95 % interval for a person."""
        note = "" if self.free else " (known)"
        if self.at_bound:
            note = " (at its bound)"
        return f"{self.value:.5g}{plus_minus(self.stderr)} {self.unit}".strip() + note


def fit_to_statuses(node: str, summary: FitSummary) -> list[Status]:
    """Return the statuses of ``estimator/fit``."""
    seconds = (summary.validation_window[1] - summary.validation_window[0]) / 1e9
    text = ", ".join(f"{name} {value:.1f} %" for name, value in summary.fit.items())
    message = summary.error or f"FIT {text} on {seconds:.1f} s not used in the fit"
    level = Level.WARN if summary.error else Level.OK
    return [Status(f"{node}: fit", message, level, to_values(summary), summary.model)]


def fit_from_statuses(statuses: Sequence[Status]) -> FitSummary:
    """Return the summary that `fit_to_statuses` wrote; CdrError when it cannot be read."""
    if len(statuses) != 1:
        raise CdrError(f"estimator/fit holds one status, not {len(statuses)}")
    with reading("estimator/fit", statuses) as values:
        return from_values(FitSummary, values)


def parameters_to_statuses(node: str, parameters: Sequence[ParameterSummary]) -> list[Status]:
    """Return the statuses of ``estimator/parameters``, one for each parameter."""
    return [
        Status(f"{node}: {one.name}", one.line, Level.WARN if one.at_bound else Level.OK, to_values(one), one.name)
        for one in parameters
    ]


def parameters_from_statuses(statuses: Sequence[Status]) -> list[ParameterSummary]:
    """Return the parameters that `parameters_to_statuses` wrote; CdrError when one cannot be read."""
    if not statuses:
        return []
    with reading("estimator/parameters", statuses):
        return [from_values(ParameterSummary, one.values) for one in statuses]
