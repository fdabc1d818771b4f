"""Columns that are mostly empty get stamps of their own."""

from __future__ import annotations

import numpy as np
import pytest

from idloop.records.formats.sparse_columns import with_own_stamps
from idloop.records.tables.table_files import read_table

# As PlotJuggler exports three series of several rates.
ROWS = [(0.000, 1.0, "", 20.0), (0.005, "", 5.0, ""), (0.010, 2.0, "", ""), (0.015, "", 6.0, ""), (0.020, 3.0, "", ""),
        (0.025, "", 7.0, ""), (0.030, 4.0, "", ""), (0.035, "", 8.0, 21.0)]  # fmt: skip


def _table(tmp_path, rows, header="__time,/motor/u,/motor/q,/motor/temperature"):
    text = "\n".join(",".join(map(str, row)) for row in rows)
    (tmp_path / "log.csv").write_text(f"{header}\n{text}\n")
    return read_table(tmp_path / "log.csv")


def test_series_in_one_table(tmp_path):
    table = with_own_stamps(_table(tmp_path, ROWS), "__time")
    np.testing.assert_array_equal(table.numbers("/motor/q"), [5.0, 6.0, 7.0, 8.0])
    np.testing.assert_array_equal(table.numbers(table.clocks["/motor/q"]), [0.005, 0.015, 0.025, 0.035])
    np.testing.assert_array_equal(table.numbers("/motor/temperature"), [20.0, 21.0])
    assert table.notes[-1].startswith(
        "columns whose cells are mostly empty have stamps of their own: /motor/u, /motor/q"
    )
    assert len(table.columns["__time"]) == 8


@pytest.mark.parametrize("empty", [0, 2])
def test_a_column_that_is_mostly_full_stays(tmp_path, empty):
    rows = [(0.1 * k, "" if k < empty else k) for k in range(8)]
    table = _table(tmp_path, rows, "t,u")
    assert with_own_stamps(table, "t") is table


def test_a_column_without_values_stays(tmp_path):
    table = _table(tmp_path, [(0.1 * k, k, "") for k in range(5)], "t,u,v")
    assert with_own_stamps(table, "t") is table


def test_texts_and_missing_samples(tmp_path):
    table = _table(tmp_path, [(k, "on" if k % 4 == 0 else "") for k in range(8)], "t,state")
    own = with_own_stamps(table, "t")
    assert own.raw("state") == ["on", "on"]
    np.testing.assert_array_equal(own.numbers("state.time"), [0.0, 4.0])
