"""A model beside records in words: measures of every output, residual tests, where the model fails."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from idloop.reporting.residual_findings import residual_findings
from idloop.reporting.text.blocks import Block, Table, number
from idloop.spelling import listed
from idloop.validation.words import fit_text, force_text

if TYPE_CHECKING:
    from idloop.validation import Comparison
    from idloop.validation.where import ErrorMap

    Rows = Sequence[tuple[str, Comparison]]

# Of what stands out: so much of the first error, the drive force where there is one, and of every further one.
_FIRST, _FURTHER = 2, 1
# FIT of a free run below which a model is worth a diagnosis, and below which it may not move by the command at all [%].
_GOOD, _MISSES = 90.0, 20.0


def measures_of(rows: Rows) -> Iterator[Block]:
    """Yield the table of measures, one line for each output.

    `rows`: sequence of (str, Comparison). What the first column says, and the comparison.
    """
    table = []
    for label, comparison in rows:
        measures = zip(comparison.names, comparison.model.outputs, strict=True)
        for index, (name, output) in enumerate(measures):
            force = comparison.force
            table.append(
                (
                    label,
                    comparison.record.name,
                    name,
                    fit_text(comparison.fit[name]),
                    number(comparison.nrmse[name]),
                    number(comparison.rmse[name]),
                    output.unit,
                    fit_text(comparison.fit_ahead[name]),
                    # One force for the whole record: printed once.
                    "-" if force is None or index else force_text(force.relative, 4),
                )
            )
    steps = rows[0][1].steps
    header = ("", "record", "output", "FIT %", "NRMSE", "RMSE", "unit", f"FIT % {steps} ahead", "force error %")
    yield Table.of(header, table)
    for reason in dict.fromkeys(comparison.no_force for _, comparison in rows if comparison.no_force):
        yield f"no force error: {reason}"
    yield from _force_of_noise(rows)


def _force_of_noise(rows: Rows) -> Iterator[Block]:
    """Yield why force errors that sensor noise makes are far larger than what a fit leaves of the force."""
    noisy = [(one.force, one.record.name) for _, one in rows if one.force is not None and not one.force.trusted]
    if noisy:
        worst = max((force for force, _ in noisy), key=lambda force: force.noise)
        yield (
            f"force error of {listed(name for _, name in noisy)}: sensor noise alone makes"
            f" {force_text(worst.noise, 3, ' %')}, as the motion is differentiated up to {worst.band:.3g} Hz: it says"
            " nothing of the model. The force balance of a fit is over smooth windows, where noise averages out, and so"
            " leaves a smaller part"
        )


def misses_every_output(comparisons: Iterable[Comparison]) -> bool:
    """Whether the FIT of a free run is below 20 % for every output of some record."""
    return any(max(one.fit.values()) < _MISSES for one in comparisons)


@dataclass(frozen=True)
class WorstOutput:
    """The output whose free run is worst."""

    fit: float  # FIT [%]
    output: str
    record: str

    @property
    def good(self) -> bool:
        """Whether the model needs no diagnosis: a FIT of 90 % or more."""
        return self.fit >= _GOOD

    @property
    def text(self) -> str:
        """How bad it is, in words."""
        fit = fit_text(self.fit, 4, " %")
        if fit.endswith("%"):
            return f"the free run misses {self.output} of {self.record} (FIT {fit})"
        return f"the free run of {self.output} of {self.record} is {fit}"


def worst_output(rows: Rows) -> WorstOutput | None:
    """The output whose free run is worst; None where none was judged."""
    found = [
        WorstOutput(fit, name, comparison.record.name)
        for _, comparison in rows
        for name, fit in comparison.fit.items()
        if not math.isnan(fit)
    ]
    return min(found, key=lambda one: one.fit, default=None)


def hint(rows: Rows) -> Iterator[Block]:
    """Yield what to do next when the free run of an output has a FIT below 90 %."""
    worst = worst_output(rows)
    if worst is not None and not worst.good:
        yield f"{worst.text}: idloop diagnose with the same model and bags names the physical effect that is missing"


def details(rows: Rows) -> Iterator[Block]:
    """Yield every residual test and every share of the error by region of motion."""
    for label, comparison in rows:
        for test in (one.test for one in residual_findings([comparison])):
            white = "white" if test.white else "not white"
            free = f" (p {test.cross_p:.2g})" if test.decided else ""
            yield (
                f"{label}: residual of {test.name} is {white} (Ljung-Box p {test.ljung_box_p:.2g})"
                f" and {test.freedom}{free}"
            )
        for name, regions in comparison.share.items():
            parts = (
                f"{region} {100 * part['error']:.0f} % (of time {100 * part['time']:.0f} %)"
                for region, part in regions.items()
            )
            yield f"{label}: squared error of {name}: {', '.join(parts)}"


def where_it_fails(rows: Rows) -> Iterator[Block]:
    """Yield where each model fails, every line of it."""
    for label, comparison in rows:
        yield f"{label}: where the error of {comparison.record.name} falls"
        for line in comparison.where.lines():
            yield f"  {line}"


def in_brief(rows: Rows) -> Iterator[Block]:
    """Yield the most telling of residual tests and of where each model fails, a few lines for each model."""
    for label, comparison in rows:
        yield f"{label}, {comparison.record.name}:"
        verdicts = _brief_verdicts(comparison)
        if verdicts:
            yield f"  one-step residual: {verdicts}"
        for index, one in enumerate(comparison.where.maps):
            for line in brief_map(one, _FIRST if index == 0 else _FURTHER):
                yield f"  {line}"


def _brief_verdicts(comparison: Comparison) -> str:
    """Residual tests in one line; outputs with the same result together."""
    named: dict[str, list[str]] = {}
    for test in (one.test for one in residual_findings([comparison])):
        white = "white" if test.white else "not white"
        named.setdefault(f"{white}, {test.freedom}", []).append(test.name)
    return "; ".join(f"{' and '.join(names)} {text}" for text, names in named.items())


def brief_map(one: ErrorMap, most: int) -> list[str]:
    """How large an error is, along what it falls most, what it follows, and its worst stretch."""
    head, *rest = one.lines()
    shown = [head]
    # As `lines` writes them: why, what stands out (most first), what does not, what it follows, the worst stretches.
    rest = rest[1:] if one.why else rest
    shown += rest[: min(most, sum(breakdown.stands_out for breakdown in one.breakdowns))]
    if most == _FIRST:
        shown += [line for line in rest if line.startswith("  a curve over one variable")]
        shown += [f"  worst: {stretch.line()}" for stretch in one.loud_stretches[:1]]
    return shown
