"""Where a model fails on a stretch of data: its free run and the error along everything that may explain it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from idloop.arrays import Array, Integers

if TYPE_CHECKING:
    from idloop.diagnosis import Candidate
    from idloop.physics import Model
    from idloop.records import Record
    from idloop.reporting.frequency_view import FrequencyView
    from idloop.reporting.residual_findings import ResidualFinding
    from idloop.validation.characteristic import Characteristic
    from idloop.validation.where import Where

Report = Callable[[float, str], None]

FEWEST = 200  # samples that are worth an assessment
MOST_PICTURES = 16


@dataclass(frozen=True, eq=False)
class Assessment:
    """A model beside a stretch of data."""

    model: Model  # that was assessed
    record: str
    stamps: Integers  # shape (n,): of the measurements [ns]
    # shape (n, p): free run and one step ahead; NaN where there is none
    simulated: Array
    predicted: Array
    innovation: Array  # shape (n, p): measured minus one step ahead
    error: Array  # shape (n, p): measured minus free run
    # ``fit`` of the free run by output [%] and ``force``, as a step of a ladder has them, and ``ahead``, the FIT of the
    # prediction ``steps`` samples ahead
    errors: dict[str, Any]
    where: Where
    frequency: FrequencyView | None = None  # Bode plot and poles
    residual_tests: tuple[ResidualFinding, ...] = ()  # of the one-step errors, output by output

    def looked_at(self, error: str) -> str:
        """Output whose error it is; of the drive force the first output whose residual test objects, or the first."""
        if error in self.model.output_names:
            return error
        tests = [one.test for one in self.residual_tests]
        objects = max(tests, key=lambda test: (test.follows, test.coloured), default=None)
        return self.model.output_names[0] if objects is None else objects.name


def assess(model: Model, record: Record, report: Report, measures: Mapping[str, str] | None = None) -> Assessment:
    """Compare a model, its parameters as they are, with a record.

    `measures`: by output the error to break down, that of the model before: as `idloop.validation.compare` takes them.
    Raises InputError, IdloopError: as `idloop.validation.compare`.
    """
    from idloop.reporting.frequency_view import frequency_view
    from idloop.reporting.residual_findings import residual_findings
    from idloop.reporting.scores import comparison_errors
    from idloop.validation import compare

    report(0.1, "free run")
    comparison = compare(model, record, measures=measures)
    simulated = comparison.simulated
    report(0.5, "where it fails")
    found = comparison.where
    return Assessment(
        model, record.name, record.absolute(record.time), simulated, comparison.predicted, comparison.innovation,
        comparison.measured - simulated, comparison_errors(comparison), found, frequency_view(comparison),
        tuple(residual_findings([comparison])),
    )  # fmt: skip


def draw_characteristics(candidates: Sequence[Candidate], record: Record, report: Report) -> dict[str, Characteristic]:
    """Read the characteristics of effects that may be missing off a record.

    `candidates`: best first; those that were not fitted, and have no model, are passed over.
    Returns: by ``effect@site``; without those that the record does not show.
    """
    from idloop.errors import IdloopError
    from idloop.validation.characteristic import characteristic

    found = {}
    # Those with the best evidence first: every effect of a tie has its picture before one that was only weighed.
    fitted = [(one, one.model) for one in sorted(candidates, key=lambda one: one.p_value) if one.model is not None]
    for number, (one, model) in enumerate(fitted[:MOST_PICTURES]):
        report(number / len(fitted), f"characteristic of {one.name}")
        try:
            drawn = characteristic(model, one.name, record)
        except IdloopError:
            continue
        if drawn is not None:
            found[one.name] = drawn
    return found
