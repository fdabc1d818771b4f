"""Everything that a report says, computed once: comparisons, characteristics, describing functions."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from idloop.errors import IdloopError
from idloop.reporting.panel import Panel, make_panel
from idloop.reporting.residual_findings import FEWEST_FOR_TESTS, believed_noise, refuted_noise
from idloop.reporting.scores import scores_of
from idloop.reporting.terms import FITTED, UNSEEN
from idloop.validation import Comparison, compare, share_measures
from idloop.validation.characteristic import Characteristic, characteristic
from idloop.validation.where import DRIVE_FORCE, ErrorMap

if TYPE_CHECKING:
    from idloop.diagnosis import Ladder
    from idloop.diagnosis.design.suggest import Suggestion
    from idloop.estimation.describing_functions import MeasuredDescribingFunction
    from idloop.physics import Model
    from idloop.records import Record
    from idloop.validation.residual import ResidualTest

# A stepped sine has at least so many steps, and its source is nearly a sine.
_STEPS, _PURE = 3, 0.2


@dataclass(frozen=True)
class Judged:
    """One record beside the first and the last model of a ladder."""

    use: str
    rows: tuple[tuple[str, Comparison], ...]  # label and comparison, one where nothing was added
    # The last model whose drive force can be read off the motion, where that is not the last one
    driven: tuple[str, Comparison] | None = None

    @property
    def force_rows(self) -> tuple[tuple[str, Comparison], ...]:
        """Those for the drive force: as `rows`, but the last one of which it is known."""
        return self.rows if self.driven is None else (self.rows[0], self.driven)

    @property
    def record(self) -> Record:
        """The record."""
        return self.rows[0][1].record

    @property
    def title(self) -> str:
        """Its use and its name."""
        return f"{self.use} data: {self.record.name}"

    @property
    def panel(self) -> Panel:
        """Measured and modelled outputs, as the figures of comparisons take them."""
        return make_panel(self.title, self.rows)

    @property
    def residual_tests(self) -> list[ResidualTest]:
        """Tests of the last model; none of a short record."""
        return self.rows[-1][1].residual_tests() if len(self.record.time) >= FEWEST_FOR_TESTS else []

    def maps(self, name: str) -> list[tuple[str, ErrorMap]]:
        """Label and error map of the first and the last model, of one output or the drive force, where known."""
        rows = self.force_rows if name == DRIVE_FORCE else self.rows
        return [(label, one) for label, c in rows for one in c.where.maps if one.name == name]


@dataclass(frozen=True)
class Contents:
    """What a report says."""

    ladder: Ladder
    judged: tuple[Judged, ...]  # unseen records first
    floor: Mapping[str, float]  # NRMSE that the noise of each output alone leaves
    # By the name of the effect, of those that the data show: what the last model leaves without it
    characteristics: Mapping[str, Characteristic]
    describing: tuple[MeasuredDescribingFunction, ...]  # where sines were run
    suggestion: Suggestion | None = None  # the next experiment with its rivals
    provenance: Mapping[str, Any] = field(default_factory=dict)
    # Outputs that are quieter than the model file says, and the most that their noise can be
    refuted_noise: Mapping[str, float] = field(default_factory=dict)
    # Step whose model a characteristic was drawn with, where the last one does not show it
    drawn_at: Mapping[str, int] = field(default_factory=dict)


def driven_step(ladder: Ladder) -> int | None:
    """Last step whose drive force is known, where the last one's is not; None where it is, or only the first's."""
    known = [n for n, step in enumerate(ladder.steps) if DRIVE_FORCE in scores_of(step.validation or step.train)]
    return known[-1] if known and known[-1] not in (0, len(ladder.steps) - 1) else None


def labelled_models(ladder: Ladder) -> list[tuple[str, Model]]:
    """First and last model of a ladder with their names in figures."""
    more = len(ladder.steps) - 1
    return [("start", ladder.steps[0].model), *([(_effects(more), ladder.model)] if more else [])]


def _effects(count: int) -> str:
    return f"{count} effects" if count > 1 else "1 effect"


def gather(
    ladder: Ladder,
    records: Sequence[Record],
    validation: Sequence[Record],
    *,
    suggestion: Suggestion | None = None,
    provenance: Mapping[str, Any] | None = None,
    progress: Callable[[float, str], None] | None = None,
) -> Contents:
    """Compute everything that a report says of a ladder, what it was fitted to, and what it did not see."""
    report = progress or (lambda share, text: None)
    models = labelled_models(ladder)
    # What was not fitted first, and the longest of it: where the model fails is read off the first.
    validation = sorted(validation, key=lambda record: -record.duration)
    every = [(UNSEEN, record) for record in validation] + [(FITTED, record) for record in records]
    # A characteristic wants much motion, fitted or not.
    longest = sorted((record for _, record in every), key=lambda record: -record.duration)
    driven = driven_step(ladder)
    judged = []
    for index, (use, record) in enumerate(every):
        report(0.8 * index / max(len(every), 1), f"comparing with {record.name}")
        one_more = None if driven is None else (_effects(driven), compare(ladder.steps[driven].model, record))
        rows = tuple((label, compare(model, record)) for label, model in models)
        share_measures([one for _, one in (*rows, *([one_more] if one_more else []))])
        judged.append(Judged(use, rows, one_more))
    report(0.8, "characteristics")
    found: dict[str, Characteristic] = {}
    drawn_at: dict[str, int] = {}
    for number, step in enumerate(ladder.steps):
        name = "" if step.added is None else step.added.name
        # The last model has what was still missing at the step, and would lie in the dots beside the effect.
        places = [n for n in (len(ladder.steps) - 1, driven, number) if n is not None]
        having = [n for n in places if name in ladder.steps[n].model.effect_names]
        for place in dict.fromkeys(having[:2]):
            shown = (characteristic(ladder.steps[place].model, name, record) for record in longest)
            one = next((one for one in shown if one is not None), None)
            if one is not None:
                found[name] = one
                if place != having[0]:
                    drawn_at[name] = place
                break
    report(0.95, "describing functions")
    refuted = refuted_noise(comparison for one in judged for _, comparison in one.rows)
    return Contents(
        ladder, tuple(judged), noise_floor(ladder.model, validation or records, refuted), found,
        tuple(_describing([record for _, record in every])), suggestion, provenance or {}, refuted, drawn_at,
    )  # fmt: skip


def noise_floor(model: Model, records: Sequence[Record], refuted: Iterable[str] = ()) -> dict[str, float]:
    """NRMSE that the noise of each sensor alone leaves, where the model states it and the data do not refute it."""
    floor = {}
    noise = believed_noise(model, refuted)
    for column, output in enumerate(model.outputs):
        spread = float(np.nanstd(np.concatenate([record.output[:, column] for record in records])))
        if output.name in noise and spread > 0.0:
            floor[output.name] = noise[output.name] / spread
    return floor


def _describing(records: Sequence[Record]) -> list[MeasuredDescribingFunction]:
    """From the command to every output, of all records in which sines were stepped, such as one for each amplitude."""
    from idloop.estimation.describing_functions import find_dwells, measure_describing_function

    stepped, dwells = [], []
    for record in records:
        with contextlib.suppress(IdloopError):
            dwells.append(find_dwells(record))
            stepped.append(record)
    if sum(map(len, dwells)) < _STEPS:
        return []
    found = []
    for name in stepped[0].output_names:
        with contextlib.suppress(IdloopError):
            measured = measure_describing_function(stepped, None, name, dwells)
            if float(np.nanmax(measured.source_distortion)) < _PURE:
                found.append(measured)
    return found
