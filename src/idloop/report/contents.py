"""Everything that a report says, computed once: comparisons, characteristics, describing functions."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from idloop.diagnose.characteristic import Characteristic, characteristic
from idloop.errors import IdloopError
from idloop.report.use import FITTED, UNSEEN
from idloop.validate import Comparison, compare

if TYPE_CHECKING:
    from idloop.diagnose import Ladder
    from idloop.diagnose.suggest import Suggestion
    from idloop.estimate.describing import MeasuredDescribingFunction
    from idloop.physics import Model
    from idloop.records import Record

# A stepped sine has at least so many steps, and its source is nearly a sine.
_STEPS, _PURE = 3, 0.2


@dataclass(frozen=True)
class Judged:
    """One record beside the first and the last model of a ladder.

    Attributes
    ----------
    use : {"fitted", "unseen"}
    rows : tuple of (str, Comparison)
        Label and comparison, one where nothing was added.
    """

    use: str
    rows: tuple[tuple[str, Comparison], ...]

    @property
    def record(self) -> Record:
        """The record."""
        return self.rows[0][1].record

    @property
    def title(self) -> str:
        """Its use and its name."""
        return f"{self.use} data: {self.record.name}"


@dataclass(frozen=True)
class Contents:
    """What a report says.

    Attributes
    ----------
    ladder : Ladder
    judged : tuple of Judged
        Unseen records first.
    floor : mapping of str to float
        NRMSE that the noise of each output alone leaves.
    characteristics : mapping of str to Characteristic
        By the name of the effect, of those that the data show: what the last model leaves without it.
    describing : tuple of MeasuredDescribingFunction
        Where sines were run.
    suggestion : Suggestion or None
        The next experiment with its rivals.
    provenance : mapping
    """

    ladder: Ladder
    judged: tuple[Judged, ...]
    floor: Mapping[str, float]
    characteristics: Mapping[str, Characteristic]
    describing: tuple[MeasuredDescribingFunction, ...]
    suggestion: Suggestion | None = None
    provenance: Mapping[str, Any] = field(default_factory=dict)


def labelled_models(ladder: Ladder) -> list[tuple[str, Model]]:
    """First and last model of a ladder with their names in figures.

    Parameters
    ----------
    ladder : Ladder

    Returns
    -------
    list of (str, Model)
    """
    found = [("start", ladder.steps[0].model)]
    more = len(ladder.steps) - 1
    if more:
        found.append((f"{more} effects" if more > 1 else "1 effect", ladder.model))
    return found


def gather(
    ladder: Ladder,
    records: Sequence[Record],
    validation: Sequence[Record],
    *,
    suggestion: Suggestion | None = None,
    provenance: Mapping[str, Any] | None = None,
    progress: Callable[[float, str], None] | None = None,
) -> Contents:
    """Compute everything that a report says.

    Parameters
    ----------
    ladder : Ladder
    records, validation : sequence of Record
        What the ladder was fitted to, and what it did not see.
    suggestion : Suggestion, optional
    provenance : mapping, optional
    progress : callable, optional
        Called with the share done and a text.

    Returns
    -------
    Contents
    """
    tell = progress or (lambda share, text: None)
    models = labelled_models(ladder)
    # What was not fitted first, and the longest of it: where the model fails is read off the first.
    validation = sorted(validation, key=lambda record: -record.duration)
    every = [(UNSEEN, record) for record in validation] + [(FITTED, record) for record in records]
    # A characteristic wants much motion, fitted or not.
    longest = sorted((record for _, record in every), key=lambda record: -record.duration)
    judged = []
    for index, (use, record) in enumerate(every):
        tell(0.8 * index / max(len(every), 1), f"comparing with {record.name}")
        judged.append(Judged(use, tuple((label, compare(model, record)) for label, model in models)))
    tell(0.8, "characteristics")
    found: dict[str, Characteristic] = {}
    for step in ladder.steps:
        name = "" if step.added is None else step.added.name
        # The last model has what was still missing at the step, and would lie in the dots beside the effect.
        model = ladder.model if name in ladder.model.effect_names else step.model
        if step.added is not None and name in model.effect_names:
            shown = (characteristic(model, name, record) for record in longest)
            one = next((one for one in shown if one is not None), None)
            if one is not None:
                found[name] = one
    tell(0.95, "describing functions")
    return Contents(
        ladder, tuple(judged), noise_floor(ladder.model, validation or records), found,
        tuple(_describing([record for _, record in every])), suggestion, provenance or {},
    )  # fmt: skip


def noise_floor(model: Model, records: Sequence[Record]) -> dict[str, float]:
    """NRMSE that the measurement noise alone leaves, by output; only where the model states the noise.

    Parameters
    ----------
    model : Model
    records : sequence of Record

    Returns
    -------
    dict
    """
    floor = {}
    for column, output in enumerate(model.outputs):
        spread = float(np.nanstd(np.concatenate([record.output[:, column] for record in records])))
        if output.noise is not None and spread > 0.0:
            floor[output.name] = output.noise / spread
    return floor


def _describing(records: Sequence[Record]) -> list[MeasuredDescribingFunction]:
    """From the command to every output, of all records in which sines were stepped, such as one for each amplitude."""
    from idloop.estimate.describing import find_dwells, measure_describing_function

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
