"""Values with the stamps of each, as columns."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from idloop.records.tables.table import Table


def set_series(table: Table, series: Mapping[str, tuple[Any, Any]], clock: str, unit: str) -> None:
    """Make series the columns of a table: with one column of stamps where all have the same, each with its own else.

    `series`: mapping of str to (stamps, values). Of equal length; numbers or texts.
    `clock`: name for the stamps; those of the series ``a`` become ``a.clock``.
    `unit`: of the stamps; empty where it is not known.
    """
    first, *others = [np.asarray(stamps) for stamps, _ in series.values()]
    common = all(np.array_equal(first, other) for other in others)
    table.columns = {}
    for name, (stamps, values) in series.items():
        own = clock if common else f"{name}.{clock}"
        table.columns |= {own: stamps, name: values}
        table.units |= {own: unit} if unit else {}
        if not common:
            table.clocks[name] = own
