"""Whether two models move alike, however clear the data that tell them apart.

Clean data has the power to show differences far below what anybody means by an effect: another way to integrate the
same equations, a stamp that is a microsecond off. All answers are no where a simulation fails.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from idloop.diagnosis.evidence.quantisation import rounding_step
from idloop.errors import IdloopError
from idloop.estimation.dataset import Data, prepare
from idloop.estimation.optimisation.caching_engine import CachingEngine
from idloop.physics.model import Model
from idloop.records import Record
from idloop.validation.free_run import free_run, free_runs
from idloop.validation.measures import NEGLIGIBLE

Array = NDArray[np.float64]


def same_motion(model: Model, other: Model, records: Sequence[Record]) -> bool:
    """Whether two models of the same bodies move no output apart by more than a negligible part of its deviation.

    The commands of the records are simulated, from the start that suits the first model best.
    """
    return _alike(model, other, records, _negligible)


def same_from_another_start(model: Model, other: Model, records: Sequence[Record]) -> bool:
    """Whether two models move alike when each begins where it suits it best: an unknown start does the same."""
    return _alike(model, other, records, _negligible, one_start=False)


def within_rounding(model: Model, other: Model, output: str, records: Sequence[Record]) -> bool:
    """Whether two models of the same motion read a sensor, by its site, apart by no more than its own rounding does."""
    column = next(i for i, o in enumerate(model.outputs) if o.site == output)
    step = rounding_step(records, column)
    if step == 0.0:
        return False
    return _alike(model, other, records, lambda data, apart: np.all(np.abs(apart[:, column]) <= 0.5 * step))


def _negligible(data: Data, apart: Array) -> np.bool_:
    seen = np.any(np.isfinite(data.output), axis=0)
    size = np.sqrt(np.nanmean(apart[:, seen] ** 2, axis=0))
    return np.all(size <= NEGLIGIBLE * np.nanstd(data.output[:, seen], axis=0))


@np.errstate(over="ignore", invalid="ignore", divide="ignore")
def _alike(
    model: Model,
    other: Model,
    records: Sequence[Record],
    judge: Callable[[Data, Array], np.bool_],
    *,
    one_start: bool = True,
) -> bool:
    """Whether a judge lets all records pass by how far the free runs of two models come apart in them, shape (n, p)."""
    first, second = CachingEngine(model), CachingEngine(other)
    try:
        for data in prepare(model, records):
            one, two = free_runs(first, data, second) if one_start else (free_run(first, data), free_run(second, data))
            if not judge(data, one - two):
                return False
    except IdloopError:
        return False
    return True
