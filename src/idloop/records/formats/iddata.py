"""Identification data of MATLAB, the object ``iddata``, which is read as a structure of its fields."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import Any

import numpy as np

from idloop.arrays import Array
from idloop.records.formats.mat_objects import listed_cells

_FIELDS = {"InputData", "OutputData", "InputName", "OutputName", "Ts", "SamplingInstants"}
_PAUSE = 10.0  # periods between experiments
Parts = dict[str, tuple[float, float]]


def series_of_iddata(value: Any) -> tuple[dict[str, Any], Parts] | None:
    """Return the stamps and channels of identification data and the times of its experiments; None for anything else.

    Several experiments are put one after the other.

    `value`: fields by name, with what they hold of cells as lists.
    """
    if not isinstance(value, Mapping) or not value.keys() >= _FIELDS:
        return None
    inputs, outputs = _experiments(value["InputData"]), _experiments(value["OutputData"])
    count = len(outputs)
    if not count or len(inputs) != count or any(len(u) != len(y) for u, y in zip(inputs, outputs, strict=True)):
        return None
    periods, starts = _of_each(value["Ts"], count), _of_each(value.get("Tstart"), count)
    instants = _experiments(value["SamplingInstants"])
    times, end = [], 0.0
    for k, output in enumerate(outputs):
        time = _times(instants[k] if len(instants) == count else None, periods[k], starts[k], len(output))
        if time is None:
            return None
        if k and time[0] <= end:
            time = time - time[0] + end + _PAUSE * float(np.median(np.diff(time)))
        times.append(time)
        end = float(time[-1])
    columns: dict[str, Any] = {"Time": np.concatenate(times)}
    unit = value.get("TimeUnit")
    # What is empty is no text, but an array without entries.
    units = {"Time": unit if isinstance(unit, str) and unit else "s"}
    for data, kind, letter in ((inputs, "Input", "u"), (outputs, "Output", "y")):
        whole = np.concatenate(data)
        names = _texts(value[f"{kind}Name"], whole.shape[1]) or [f"{letter}{k + 1}" for k in range(whole.shape[1])]
        columns |= {name: whole[:, k] for k, name in enumerate(names)}
        said = _texts(value.get(f"{kind}Unit"), whole.shape[1])
        units |= {name: unit for name, unit in zip(names, said, strict=False) if unit}
    if len(columns) != 1 + inputs[0].shape[1] + outputs[0].shape[1]:
        return None
    named = _texts(value.get("ExperimentName"), count) or [f"experiment {k + 1}" for k in range(count)]
    edges = [*(float(time[0]) for time in times), np.inf]
    parts = dict(zip(named, pairwise(edges), strict=True)) if count > 1 else {}
    return columns | {"VariableUnits": units}, parts


def _cells(value: Any) -> list[Any]:
    if isinstance(value, np.ndarray) and value.dtype.kind in "OU":
        return list(value.ravel())
    return listed_cells(value)


def _experiments(value: Any) -> list[Array]:
    """Samples by channels, of each experiment."""
    several = [value] if isinstance(value, np.ndarray) and value.dtype.kind in "biuf" else _cells(value)
    found = [np.asarray(one, dtype=np.float64) for one in several if np.asarray(one).dtype.kind in "biuf"]
    return [one[:, None] if one.ndim == 1 else one for one in found if 0 < one.ndim < 3]


def _of_each(value: Any, count: int) -> list[float]:
    """Return a number of each experiment; NaN where it is not said."""
    cells = [value] if isinstance(value, int | float) else _cells(value)
    numbers = [float(np.asarray(one).ravel()[0]) if np.size(one) else np.nan for one in cells]
    return numbers if len(numbers) == count else numbers[:1] * count if len(numbers) == 1 else [np.nan] * count


def _times(instants: Array | None, period: float, start: float, count: int) -> Array | None:
    if instants is not None and instants.size == count > 1:
        return np.asarray(instants.ravel(), dtype=np.float64)
    if not (np.isfinite(period) and period > 0.0 and count > 1):
        return None
    return np.asarray((start if np.isfinite(start) else 0.0) + period * np.arange(count), dtype=np.float64)


def _texts(value: Any, count: int) -> list[str]:
    """Return a text of each channel; nothing where there are not as many."""
    cells = [value] if isinstance(value, str) else _cells(value)
    texts = [one if isinstance(one, str) else "" for one in cells]
    return texts if len(texts) == count else []
