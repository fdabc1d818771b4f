"""Lists of runs: of each run a mapping with the same arrays."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import accumulate, chain
from pathlib import Path
from typing import Any

import numpy as np

from idloop.records.formats.tree import table_of_tree
from idloop.records.recognition.column_name import parse_column_name
from idloop.records.recognition.roles import role_by_name
from idloop.records.tables.table import Table
from idloop.spelling import joined_names

# Lists of what was recorded at the same time, by the word of their name.
_BESIDE_EACH_OTHER = {
    "joint", "joints", "motor", "motors", "axis", "axes", "servo", "servos", "actuator", "actuators", "channel",
    "channels", "signal", "signals", "topic", "topics", "series", "traces",
}  # fmt: skip
_FEWEST_ROWS = 3


def runs_in(content: Any, key: str | None = None) -> tuple[list[Any], list[str], dict[str, Any]] | None:
    """Return a list of runs with the names of their arrays and what stands beside it; None where there is none.

    `key`: of the list in a mapping; None for any.
    """
    if not isinstance(content, Mapping):
        names = _arrays_of_runs("", content, {})
        return (content, names, {}) if names else None
    for place in content if key is None else [key]:
        beside = {name: value for name, value in content.items() if name != place}
        if names := _arrays_of_runs(str(place), content[place], beside):
            return content[place], names, beside
    return None


def _arrays_of_runs(name: str, value: Any, others: Mapping[str, Any]) -> list[str]:
    """Return the arrays that each run has, of one length in a run; empty where a list is none of runs.

    Samples with vectors are more than the vectors are long, and all of theirs are of one length. Signals are named.

    `name`: of the list; empty without one.
    `others`: what stands beside the list: an array of their length belongs to all, as the stamps of several joints do.
    """
    if not isinstance(value, list) or not value or not all(isinstance(run, Mapping) for run in value):
        return []
    lengths = [{key: len(one) for key, one in run.items() if _is_array(one)} for run in value]
    names = [key for key in lengths[0] if all(key in one for one in lengths)]
    rows = [max((one[key] for key in names), default=0) for one in lengths]
    names = [key for key in names if all(one[key] == count for one, count in zip(lengths, rows, strict=True))]
    if len(names) < 2 or min(rows) < _FEWEST_ROWS or (len(set(rows)) == 1 and rows[0] <= len(value)):
        return []
    beside = set(parse_column_name(name).words) & _BESIDE_EACH_OTHER
    beside |= {key for key, one in others.items() if _is_array(one) and len(one) in rows}
    texts = [key for key, one in value[0].items() if isinstance(one, str)]
    roles = {role_by_name(parse_column_name(str(run.get(key)))).role for run in value for key in texts}
    return [] if beside or roles & {"command", "position", "velocity"} else names


def table_of_runs(path: Path, runs: list[Mapping[str, Any]], names: list[str], others: Mapping[str, Any]) -> Table:
    """Return the arrays of runs one after the other, with the rows at which a run begins.

    `names`: arrays that each has.
    `others`: what stands beside the list.
    """
    table = table_of_tree(path, {name: list(chain.from_iterable(run[name] for run in runs)) for name in names})
    table.begins = tuple(accumulate((len(run[names[0]]) for run in runs[:-1]), initial=0))
    table.attributes = table_of_tree(path, others).attributes
    if len(runs) > 1:
        table.notes.append(f"it holds a list of {len(runs)} runs, each with {joined_names(names)}")
    return table


def _is_array(value: Any) -> bool:
    return isinstance(value, list) or (isinstance(value, np.ndarray) and value.ndim > 0)
