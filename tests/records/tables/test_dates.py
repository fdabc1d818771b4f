"""Dates of several spellings as nanoseconds since 1970."""

from __future__ import annotations

import numpy as np
import pytest

from idloop.records.tables.stamps import date_ns, dates_ns

SECOND = 1_000_000_000
NINE = 1_740_906_000 * SECOND  # 2025-03-02 09:00:00 in UTC


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("2025-03-02T09:00:00Z", NINE),
        ("2025-03-02 09:00", NINE),
        (" 2025-03-02 09:00:00 UTC ", NINE),
        ("2025-03-02T09:00:00.123456789Z", NINE + 123_456_789),
        ("2025-03-02 09:00:00,5", NINE + SECOND // 2),
        ("2025-03-02T10:00:00.25+01:00", NINE + SECOND // 4),
        ("2025-03-02T10:00:00.25+0100", NINE + SECOND // 4),
        ("2025-03-02T05:30:00-03:30", NINE),
        ("2025-03-02T10:00:00+01", NINE),
        ("2025-03-02", NINE - 9 * 3600 * SECOND),
        ("1969-12-31T23:59:59Z", -SECOND),
    ],
)
def test_a_date(text, expected):
    assert date_ns(text) == expected


@pytest.mark.parametrize("text", ["", "09:00:00", "2025-13-02 09:00:00", "2025-03-02 25:00:00", 12.5, "2025/03/02"])
def test_what_is_none(text):
    assert date_ns(text) is None
    assert dates_ns(["2025-03-02", text]) is None


def test_a_column_over_the_change_to_summer_time():
    cells = ["2025-03-30 01:59:59.5+01:00", "2025-03-30 03:00:00.0+02:00"]
    np.testing.assert_array_equal(np.diff(dates_ns(cells)), [SECOND // 2])


def test_no_cells_hold_no_dates():
    assert dates_ns([]) is None
