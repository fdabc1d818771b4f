"""Fit and parameters as diagnostic statuses and back, without loss.

The message of a status is for a person (one decimal); the key values hold full precision.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from idloop.records.bags.cdr import CdrError
from idloop_nodes.codec.diagnostics import Level, Status
from idloop_nodes.codec.numbers import number_or_none, plus_minus, text_or_empty


@dataclass(frozen=True)
class FitSummary:
    """What one fit on a window is worth on the samples after it.

    Attributes
    ----------
    model : str
        Name of the model.
    effects : tuple of str
        Effects in the model, ``name@site``.
    criterion : str
        What was minimised.
    fit_window, validation_window : tuple of int
        First and last stamp in nanoseconds.
    fit : dict of str to float
        FIT per output in percent on the validation window, which the fit never saw.
    fit_train : dict of str to float
        FIT per output in percent on the fit window.
    loss : float
        Loss of the fit.
    whiteness : dict of str to float
        By output, the probability that a white residual of the free run on the validation window looks like this.
    error : str
        Why there is no fit, one line; empty when there is one.
    missed : dict of str to float
        By output, rms error of the free run on the validation window over the sensor's noise.
    """

    model: str
    effects: tuple[str, ...] = ()
    criterion: str = ""
    fit_window: tuple[int, int] = (0, 0)
    validation_window: tuple[int, int] = (0, 0)
    fit: dict[str, float] = field(default_factory=dict)
    fit_train: dict[str, float] = field(default_factory=dict)
    loss: float = float("nan")
    whiteness: dict[str, float] = field(default_factory=dict)
    error: str = ""
    missed: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class ParameterSummary:
    """One parameter of a fitted model: value, standard error, unit, bounds; whether it may be trusted, and why."""

    name: str
    value: float
    stderr: float | None = None
    unit: str = ""
    minimum: float | None = None
    maximum: float | None = None
    free: bool = True
    trusted: bool = False
    why: str = ""

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
    values = {
        "model": summary.model,
        "effects": " ".join(summary.effects),
        "criterion": summary.criterion,
        "fit_window": " ".join(map(str, summary.fit_window)),
        "validation_window": " ".join(map(str, summary.validation_window)),
        "loss": repr(float(summary.loss)),
        "error": summary.error,
    }
    values |= {f"fit/{name}": repr(float(value)) for name, value in summary.fit.items()}
    values |= {f"train/{name}": repr(float(value)) for name, value in summary.fit_train.items()}
    values |= {f"missed/{name}": repr(float(value)) for name, value in summary.missed.items()}
    values |= {f"white/{name}": repr(float(value)) for name, value in summary.whiteness.items()}
    if summary.error:
        return [Status(f"{node}: fit", summary.error, Level.WARN, values, summary.model)]
    seconds = (summary.validation_window[1] - summary.validation_window[0]) / 1e9
    text = ", ".join(f"{name} {value:.1f} %" for name, value in summary.fit.items())
    message = f"FIT {text} on {seconds:.1f} s not used in the fit"
    return [Status(f"{node}: fit", message, Level.OK, values, summary.model)]


def fit_from_statuses(statuses: Sequence[Status]) -> FitSummary:
    """Return the summary that `fit_to_statuses` wrote.

    Raises
    ------
    CdrError
        When a value is missing or no number.
    """
    if len(statuses) != 1:
        raise CdrError(f"estimator/fit holds one status, not {len(statuses)}")
    values = statuses[0].values
    try:
        return FitSummary(
            model=values["model"],
            effects=tuple(values["effects"].split()),
            criterion=values["criterion"],
            fit_window=_window(values["fit_window"]),
            validation_window=_window(values["validation_window"]),
            fit=_numbers(values, "fit/"),
            fit_train=_numbers(values, "train/"),
            loss=float(values["loss"]),
            whiteness=_numbers(values, "white/"),
            error=values["error"],
            missed=_numbers(values, "missed/"),
        )
    except (KeyError, ValueError) as error:
        raise CdrError(f"estimator/fit cannot be read: {error}") from error


def parameters_to_statuses(node: str, parameters: Sequence[ParameterSummary]) -> list[Status]:
    """Return the statuses of ``estimator/parameters``, one for each parameter."""
    statuses = []
    for one in parameters:
        values = {
            "parameter": one.name,
            "value": repr(float(one.value)),
            "stderr": text_or_empty(one.stderr),
            "unit": one.unit,
            "min": text_or_empty(one.minimum),
            "max": text_or_empty(one.maximum),
            "free": "true" if one.free else "false",
            "trusted": "true" if one.trusted else "false",
            "why": one.why,
        }
        level = Level.WARN if one.at_bound else Level.OK
        statuses.append(Status(f"{node}: {one.name}", one.line, level, values, one.name))
    return statuses


def parameters_from_statuses(statuses: Sequence[Status]) -> list[ParameterSummary]:
    """Return the parameters that `parameters_to_statuses` wrote.

    Raises
    ------
    CdrError
        When a value is missing or no number.
    """
    try:
        return [
            ParameterSummary(
                name=status.values["parameter"],
                value=float(status.values["value"]),
                stderr=number_or_none(status.values["stderr"]),
                unit=status.values["unit"],
                minimum=number_or_none(status.values["min"]),
                maximum=number_or_none(status.values["max"]),
                free=status.values["free"] == "true",
                trusted=status.values.get("trusted") == "true",
                why=status.values.get("why", ""),
            )
            for status in statuses
        ]
    except (KeyError, ValueError) as error:
        raise CdrError(f"estimator/parameters cannot be read: {error}") from error


def _window(text: str) -> tuple[int, int]:
    start, stop = text.split()
    return int(start), int(stop)


def _numbers(values: dict[str, str], prefix: str) -> dict[str, float]:
    return {key[len(prefix) :]: float(value) for key, value in values.items() if key.startswith(prefix)}
