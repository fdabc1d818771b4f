"""Several files of one experiment, each with a signal or more, as one table."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from idloop.records.tables.table import Table


def joined_tables(folder: Path, tables: Sequence[Table]) -> Table:
    """Join tables: the column ``u`` of ``drive.csv`` becomes ``drive.u``.

    `folder`: where they lie, for messages.
    `tables`: files of different names; each keeps its time columns.
    """
    whole = Table(folder, {})
    for table in tables:
        stem = table.path.stem
        whole.columns |= {f"{stem}.{name}": column for name, column in table.columns.items()}
        whole.units |= {f"{stem}.{name}": unit for name, unit in table.units.items()}
        whole.clocks |= {f"{stem}.{name}": f"{stem}.{clock}" for name, clock in table.clocks.items()}
        whole.attributes |= {f"{stem}.{name}": value for name, value in table.attributes.items()}
        whole.notes += [f"{table.path.name}: {note}" for note in table.notes]
        whole.first_row = table.first_row
    return whole
