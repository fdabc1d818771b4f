"""A text with a row for each signal is turned; one with a row for each sample is not."""

from __future__ import annotations

import numpy as np
import pytest

from idloop.records.tables.table_files import read_table

T = 0.01 * np.arange(200)
ROWS = [T, np.sign(np.sin(9.0 * T)), np.cos(T)]


def _text(names):
    return "".join(
        name + ",".join(f"{value:.6f}" for value in row) + "\n" for name, row in zip(names, ROWS, strict=True)
    )


@pytest.mark.parametrize(
    ("names", "columns"), [(("t [s],", "u,", "q,"), ["t [s]", "u", "q"]), (("", "", ""), ["0", "1", "2"])]
)
def test_rows_are_signals(tmp_path, names, columns):
    (tmp_path / "a.csv").write_text(_text(names))
    table = read_table(tmp_path / "a.csv")
    assert list(table.columns) == columns
    for name, row in zip(columns, ROWS, strict=True):
        np.testing.assert_allclose(table.columns[name], row, atol=1e-6)
    assert table.notes[-1].startswith("each of its 3 rows is a signal")


@pytest.mark.parametrize(
    "text",
    [
        "\n".join(f"{a},{b},{c}" for a, b, c in zip(*ROWS, strict=True)),
        _text(("u,", "u,", "q,")),
        ",".join(f"c{k}" for k in range(200)) + "\n" + ",".join("1" * 200) + "\n",
        "\n".join(",".join("1" * 60) for _ in range(50)),
    ],
    ids=["samples", "names twice", "a header", "as many rows"],
)
def test_other_tables_stay(tmp_path, text):
    (tmp_path / "a.csv").write_text(text + "\n")
    assert not any("is a signal" in note for note in read_table(tmp_path / "a.csv").notes)
