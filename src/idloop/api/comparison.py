"""Models beside one record: free run, prediction, drive force, where each fails."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from idloop.api.result import Progress, Result, ignore_progress, names_of
from idloop.api.single_thread import single_threaded
from idloop.errors import InputError
from idloop.records import Record
from idloop.reporting.panel import make_panel
from idloop.reporting.plots.comparison import plot_panels
from idloop.reporting.plots.where import plot_where
from idloop.reporting.text.blocks import Block
from idloop.reporting.text.comparison import details, in_brief, measures_of, where_it_fails
from idloop.validation import compare as compare_record
from idloop.validation import share_measures

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from idloop.physics import Model
    from idloop.validation import Comparison as RecordComparison


@dataclass(frozen=True)
class Comparison(Result):
    """Models compared with one record.

    Attributes
    ----------
    rows : tuple of (str, idloop.validation.Comparison)
        Label of each model, and its runs on the record.
    """

    rows: tuple[tuple[str, RecordComparison], ...]

    @property
    def fit(self) -> dict[str, dict[str, float]]:
        """FIT of the free run in percent, by model and output."""
        return {label: one.fit for label, one in self.rows}

    @property
    def force_error(self) -> dict[str, float | None]:
        """Unexplained part of the drive force in percent, by model; None where a body is not measured."""
        return {label: None if one.force is None else 100.0 * one.force.relative for label, one in self.rows}

    def blocks(self, *, everything: bool = False) -> Iterator[Block]:
        """Yield measures and where the models fail; with `everything` every test, region and stretch."""
        yield from measures_of(self.rows)
        yield ""
        if not everything:
            yield from in_brief(self.rows)
            return
        yield from details(self.rows)
        yield ""
        yield from where_it_fails(self.rows)

    def plot(self) -> Figure:
        """Draw the measurement with the free run of each model, what it misses, and the command."""
        record = self.rows[0][1].record
        names = short_names([label for label, _ in self.rows])
        return plot_panels([make_panel(record.name, [(names[k], one) for k, (_, one) in enumerate(self.rows)])])

    def plot_where(self) -> Figure:
        """Draw where the models fail: along time, frequency, velocity, position, command, ..."""
        return plot_where([(label, one.where) for label, one in self.rows])

    def to_dict(self) -> dict[str, Any]:
        """Return the document of schema ``idloop/compare/1``."""
        return {
            "schema": "idloop/compare/1",
            "comparisons": [{**one.to_dict(), "label": label} for label, one in self.rows],
        }


def short_names(labels: Sequence[str]) -> list[str]:
    """Labels of a legend: of files the last parts of their paths, as many as tell them apart."""
    parts = [label.split("/") for label in labels]
    ends = (["/".join(one[-count:]) for one in parts] for count in range(1, max(map(len, parts)) + 1))
    return next((names for names in ends if len(set(names)) == len(names)), list(labels))


@single_threaded
def compare(
    models: Model | Sequence[Model],
    record: Record | Sequence[Record],
    *,
    steps: int = 10,
    labels: Sequence[str] | None = None,
    progress: Progress = ignore_progress,
) -> Comparison:
    """Compare models with a record, their parameters as they are; only the initial state is fitted.

    Parameters
    ----------
    models : Model or sequence of Model
        With equal outputs.
    record : Record or sequence of Record
        One record; or one for each model, the same measurement read with each model's signals.
    steps : int
        Samples that the prediction looks ahead.
    labels : sequence of str, optional
        Of the models; their names when left out.
    progress : callable, optional
        Called with the share done in [0, 1] and a short text.

    Raises
    ------
    InputError
        Models with different outputs, or a record that does not suit them.
    IdloopError
        Neither free run nor prediction of a model stays finite, and no drive force can be compared.

    Examples
    --------
    >>> import idloop
    >>> model = idloop.load_model("dc_motor")
    >>> signal = idloop.excitation("prbs", sample_time=0.01, duration=10.0, amplitude=5.0, band_hz=1.0)
    >>> record = idloop.simulate(model, signal)
    >>> round(idloop.compare(model, record).fit["dc_motor"]["motor.position"]) > 90
    True
    """
    several = [models] if not isinstance(models, Sequence) else list(models)
    if any(model.output_names != several[0].output_names for model in several):
        raise InputError("the models have different outputs: compare them one by one")
    records = [record] * len(several) if isinstance(record, Record) else list(record)
    rows: list[tuple[str, RecordComparison]] = []
    for label, model, one in zip(labels or names_of(several), several, records, strict=True):
        # The drive side of all models in one band, that of the first.
        force = rows[0][1].force if rows else None
        rows.append((label, compare_record(model, one, steps=steps, cutoff=force.cutoff if force else None)))
    share_measures([one for _, one in rows])
    for index, (label, comparison) in enumerate(rows):
        progress(index / len(several), label)
        comparison.compute()
    return Comparison(tuple(rows))
