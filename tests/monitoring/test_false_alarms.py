"""Rates as people write them."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from idloop.errors import InputError
from idloop.monitoring import parse_false_alarms


@pytest.mark.parametrize(
    ("text", "hours"),
    (
        ("per 1000 h", 1000.0),
        ("1 per 1000 h", 1000.0),
        ("one per 30 days", 720.0),
        ("500h", 500.0),
        ("per week", 168.0),
        ("per 1e3 h", 1000.0),
        (" per 90 min ", 1.5),
    ),
)
def test_it_reads_what_people_write(text, hours):
    assert parse_false_alarms(text) == pytest.approx(hours)


@pytest.mark.parametrize(
    "text", ("", "often", "per 0 h", "per -3 h", "per 1 fortnight", "per 1.2.3 h", "1000", "per nan h")
)
def test_anything_else_is_refused_with_an_example(text):
    with pytest.raises(InputError, match="per 1000 h"):
        parse_false_alarms(text)


@given(st.floats(1e-3, 1e6))
def test_hours_come_back(hours):
    assert parse_false_alarms(f"per {hours!r} h") == pytest.approx(hours)
