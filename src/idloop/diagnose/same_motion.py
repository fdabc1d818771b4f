"""Whether two models move alike, however clear the data that tell them apart.

Clean data has the power to show differences far below what anybody means by an effect: another way to integrate the
same equations, a stamp that is a microsecond off.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from idloop.diagnose.lattice import rounding_step
from idloop.errors import IdloopError
from idloop.estimate.dataset import Data, prepare
from idloop.estimate.engine import RememberingEngine
from idloop.physics.model import Model
from idloop.records import Record
from idloop.validate.free_run import free_run, free_runs
from idloop.validate.measures import NEGLIGIBLE

Array = NDArray[np.float64]


@np.errstate(over="ignore", invalid="ignore", divide="ignore")
def same_motion(model: Model, other: Model, records: Sequence[Record]) -> bool:
    """Whether two models of the same bodies move no output apart by more than a negligible part of its deviation.

    Parameters
    ----------
    model, other : Model
    records : sequence of Record
        Their commands are simulated, from the start that suits the first model best.

    Returns
    -------
    bool
        False where a simulation fails.
    """
    try:
        return all(_negligible(data, apart) for data, apart in _apart(model, other, records))
    except IdloopError:
        return False


@np.errstate(over="ignore", invalid="ignore", divide="ignore")
def same_from_another_start(model: Model, other: Model, records: Sequence[Record]) -> bool:
    """Whether two models move alike when each begins where it suits it best: an unknown start does the same.

    Parameters
    ----------
    model, other : Model
    records : sequence of Record

    Returns
    -------
    bool
        False where a simulation fails.
    """
    one, two = RememberingEngine(model), RememberingEngine(other)
    try:
        return all(_negligible(data, free_run(one, data) - free_run(two, data)) for data in prepare(model, records))
    except IdloopError:
        return False


def _negligible(data: Data, apart: Array) -> bool:
    seen = np.any(np.isfinite(data.output), axis=0)
    size = np.sqrt(np.nanmean(apart[:, seen] ** 2, axis=0))
    return bool(np.all(size <= NEGLIGIBLE * np.nanstd(data.output[:, seen], axis=0)))


def within_rounding(model: Model, other: Model, output: str, records: Sequence[Record]) -> bool:
    """Whether two models of the same motion read a sensor apart by no more than its own rounding does.

    Parameters
    ----------
    model, other : Model
    output : str
        Site of the sensor.
    records : sequence of Record
        As of `same_motion`.

    Returns
    -------
    bool
        False where a simulation fails.
    """
    column = next(i for i, o in enumerate(model.outputs) if o.site == output)
    step = rounding_step(records, column)
    if step == 0.0:
        return False
    try:
        return all(np.all(np.abs(apart[:, column]) <= 0.5 * step) for _, apart in _apart(model, other, records))
    except IdloopError:
        return False


def _apart(model: Model, other: Model, records: Sequence[Record]) -> Iterator[tuple[Data, Array]]:
    """Records, and how far the free runs of two models of the same bodies come apart in them, shape (n, p)."""
    engine, second = RememberingEngine(model), RememberingEngine(other)
    for data in prepare(model, records):
        one, two = free_runs(engine, data, second)
        yield data, one - two
