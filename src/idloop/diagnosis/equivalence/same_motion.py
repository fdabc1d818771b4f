"""Whether two models move alike.

Low noise makes differences significant that have no practical meaning: another integration method, a time stamp that is
a microsecond off. All answers are no where a simulation fails.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from idloop.diagnosis.evidence.quantisation import quantisation_step
from idloop.errors import IdloopError
from idloop.estimation.dataset import Data, prepare
from idloop.estimation.optimisation.caching_engine import CachingEngine
from idloop.physics.model import Model
from idloop.records import Record
from idloop.validation.free_run import free_runs
from idloop.validation.measures import NEGLIGIBLE

Array = NDArray[np.float64]


def same_motion(model: Model, other: Model, records: Sequence[Record]) -> bool:
    """Whether the free runs of two models differ by a negligible part of each output's deviation, from one start."""
    return _alike(model, other, records, _negligible)


def same_motion_from_another_place(model: Model, other: Model, records: Sequence[Record]) -> bool:
    """Whether two models move alike where the other begins at another place: an unknown start explains the same."""
    return _alike(model, other, records, _negligible, moved=True)


def within_quantisation(model: Model, other: Model, output: str, records: Sequence[Record]) -> bool:
    """Whether the readings of a sensor, by its site, differ by less than a quantum between two models.

    Rounding up or down does as much.
    """
    column = next(i for i, o in enumerate(model.outputs) if o.site == output)
    step = quantisation_step(records, column)
    if step == 0.0:
        return False
    return _alike(model, other, records, lambda data, apart: np.all(np.abs(apart[:, column]) < step))


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
    moved: bool = False,
) -> bool:
    """Whether the differences of the free runs of two models, shape (n, p), satisfy a judge in all records."""
    first, second = CachingEngine(model), CachingEngine(other)
    try:
        for data in prepare(model, records):
            one, two = free_runs(first, data, second, moved=moved)
            if not judge(data, one - two):
                return False
    except IdloopError:
        return False
    return True
