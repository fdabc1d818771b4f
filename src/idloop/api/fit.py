"""The fit of a model's free parameters, judged on fitted and unseen records."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from idloop.api.result import Progress, Result, as_records, ignore_progress, part
from idloop.api.single_thread import single_threaded
from idloop.diagnosis.screening.command_response import command_response
from idloop.diagnosis.search.non_local_search import from_trial_values
from idloop.estimation import fit as fit_model
from idloop.output_files import write_text
from idloop.reporting.panel import make_panel
from idloop.reporting.plots.comparison import plot_panels
from idloop.reporting.terms import FITTED, UNSEEN
from idloop.reporting.text.blocks import Block
from idloop.reporting.text.comparison import hint, measures_of, misses_every_output
from idloop.validation import compare

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from idloop.estimation import FitResult
    from idloop.physics import Model
    from idloop.records import Record
    from idloop.validation import Comparison as RecordComparison


@dataclass(frozen=True)
class Fit(Result):
    """A fitted model, its uncertainty, and how well it does.

    Attributes
    ----------
    result : idloop.estimation.FitResult
        Values, standard errors, covariance, criterion, warnings.
    train, validation : tuple of idloop.validation.Comparison
        The fitted model beside each record that the fit has seen, and that it has not seen.
    unrelated : str
        That the motion does not follow the command; empty where it does.
    unusable : bool
        Whether the inspection of a bag that was fitted says that it is of no use: a diagnosis would explain its fault.
    """

    result: FitResult
    train: tuple[RecordComparison, ...]
    validation: tuple[RecordComparison, ...] = ()
    unrelated: str = ""
    unusable: bool = False

    @property
    def model(self) -> Model:
        """The model with fitted values and standard errors."""
        return self.result.model

    @property
    def values(self) -> dict[str, float]:
        """Estimates by parameter, each in the parameter's unit."""
        return dict(zip(self.result.names, map(float, self.result.values), strict=True))

    @property
    def intervals(self) -> dict[str, tuple[float, float]]:
        """95 % confidence interval by parameter."""
        return {name: self.result.interval(name) for name in self.result.names}

    @property
    def determines_nothing(self) -> bool:
        """Whether the interval of every parameter contains zero, and no ratio of them is known."""
        return not self.result.ratios and not any(low > 0.0 or high < 0.0 for low, high in self.intervals.values())

    @property
    def rows(self) -> list[tuple[str, RecordComparison]]:
        """Every comparison with the use of its record: "fitted" or "unseen"."""
        return [(FITTED, one) for one in self.train] + [(UNSEEN, one) for one in self.validation]

    def blocks(self) -> Iterator[Block]:
        """Yield parameters with intervals, measures of every record, and what to do next."""
        yield self.result.summary()
        yield ""
        yield from measures_of(self.rows)
        if not (self.unrelated or self.unusable):
            yield from hint(self.rows)

    def plot(self) -> Figure:
        """Draw measurement and free run of every record, with what is left over."""
        panels = [make_panel(f"{label}: {one.record.name}", [(self.model.name, one)]) for label, one in self.rows]
        return plot_panels(panels)

    def to_dict(self) -> dict[str, Any]:
        """Return the document of schema ``idloop/fit/1``."""
        return {
            "schema": "idloop/fit/1",
            **self.result.to_dict(),
            "train": [one.to_dict() for one in self.train],
            "validation": [one.to_dict() for one in self.validation],
        }

    def save(self, path: str | Path) -> Path:
        """Write the fitted model file."""
        write_text(Path(path), self.model.to_yaml())
        return Path(path)


@single_threaded
def fit(
    model: Model,
    records: Record | Iterable[Record],
    validate: Record | Iterable[Record] = (),
    *,
    criterion: str = "auto",
    progress: Progress = ignore_progress,
) -> Fit:
    """Estimate the free parameters of a model from all records together.

    Parameters
    ----------
    model : Model
        A parameter is free where the model file writes it as a mapping.
    records, validate : Record or iterable of Record
        What is fitted, and what the fit does not see.
    criterion : {"auto", "prediction", "simulation", "force"}
        What is made small: one-step errors, free-run errors or the unexplained drive force.
    progress : callable, optional
        Called with the share done in [0, 1] and a short text.

    Raises
    ------
    InputError
        Records that do not suit the model, nothing free, or an unknown criterion.

    Examples
    --------
    >>> import idloop
    >>> model = idloop.load_model("dc_motor")
    >>> record = idloop.simulate(model, idloop.excitation("prbs", sample_time=0.01, duration=20.0))
    >>> fitted = idloop.fit(model, record)
    >>> low, high = fitted.intervals["drive.gain"]
    >>> low < fitted.values["drive.gain"] < high
    True
    """
    train, validation = as_records(records), as_records(validate)
    found = fit_and_compare(model, train, validation, criterion=criterion, progress=part(progress, 0.0, 0.95))
    return with_command_response(found, model, train, progress=part(progress, 0.95, 1.0))


@single_threaded
def fit_and_compare(
    model: Model,
    train: Sequence[Record],
    validation: Sequence[Record] = (),
    *,
    criterion: str = "auto",
    progress: Progress = ignore_progress,
) -> Fit:
    """As `fit`, but for the test of the command response, which may take longer than the fit."""
    if _needs_trial_values(model):
        progress(0.0, "finding values to start from")
    result = fit_model(_started(model, train), train, criterion=criterion, progress=part(progress, 0.0, 0.95))
    progress(0.95, "comparing")
    seen, unseen = ([compare(result.model, record) for record in part_] for part_ in (train, validation))
    return Fit(result, tuple(seen), tuple(unseen))


@single_threaded
def with_command_response(found: Fit, model: Model, train: Sequence[Record], *, progress: Progress) -> Fit:
    """Add to a fit that describes nothing the warning that the motion does not follow the command, where it does not.

    `model`, `train`: what was fitted, and to which records.
    """
    if not (misses_every_output(found.train) or found.determines_nothing):
        return found
    progress(0.0, "testing whether the motion follows the command")
    unrelated = command_response(_started(model, train), train).text
    if not unrelated:
        return found
    warned = replace(found.result, warnings=(*found.result.warnings, unrelated))
    return replace(found, result=warned, unrelated=unrelated)


def _needs_trial_values(model: Model) -> bool:
    """Whether the model file leaves a value to start from open."""
    return not all(map(math.isfinite, model.theta))


def _started(model: Model, train: Sequence[Record]) -> Model:
    """The model with a value to start from for every parameter."""
    return from_trial_values(model, train) if _needs_trial_values(model) else model
