"""Stamps in two columns are one time; other whole numbers side by side are none."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from idloop.records.tables.reshaping import join_stamps
from idloop.records.tables.table import Table

T = 1_700_000_000.5 + 0.01 * np.arange(200)
WHOLE = np.floor(T)
NS, US = np.round((T - WHOLE) * 1e9), np.round((T - WHOLE) * 1e6)


def _joined(**columns):
    table = Table(Path("a.csv"), dict(columns))
    join_stamps(table)
    return table


@pytest.mark.parametrize(
    ("whole", "rest", "parts"),
    [
        ("header.stamp.sec", "header.stamp.nanosec", NS),
        ("secs", "nsecs", NS),
        ("tv_sec", "tv_usec", US),
        ("0", "1", NS),
        ("3", "4", US),
    ],
)
def test_seconds_and_the_rest(whole, rest, parts):
    table = _joined(**{whole: WHOLE, rest: list(parts), "u": np.sin(T)})
    assert table.stamp_parts == (whole, rest)
    assert table.units["stamp"] == "s"
    np.testing.assert_allclose(table.columns["stamp"] - T[0], T - T[0], atol=1e-6)
    assert "are the seconds and" in table.notes[0]


def test_simulated_time_is_told_by_its_names():
    table = _joined(sec=WHOLE - WHOLE[0], nanosec=NS)
    np.testing.assert_allclose(np.diff(table.columns["stamp"]), 0.01, atol=1e-6)
    assert "stamp" not in _joined(**{"0": WHOLE - WHOLE[0], "1": NS}).columns


TURNS = np.arange(200) // 50
OTHERS = {
    "turns and counts": {"turns": TURNS, "counts": np.arange(200) % 50 * 20},
    "values that fill no second": {"0": WHOLE, "1": np.arange(200) % 100},
    "parts": {"sec": WHOLE, "nanosec": (T - WHOLE) * 0.5},
    "a rest beyond a second": {"sec": WHOLE, "nanosec": NS + 1e9},
    "negative ones": {"sec": WHOLE, "nanosec": -NS},
    "a time that falls": {"sec": WHOLE[::-1], "nanosec": NS[::-1]},
    "texts": {"sec": ["a"] * 200, "nanosec": NS},
}


@pytest.mark.parametrize("name", OTHERS)
def test_other_columns(name):
    columns = OTHERS[name]
    assert list(_joined(**columns).columns) == list(columns)
