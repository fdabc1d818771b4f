from math import inf

import pytest
from hypothesis import given
from hypothesis import strategies as st

from idloop.estimation.statistics.interval_text import interval_text


@pytest.mark.parametrize(
    ("low", "high", "text"),
    [
        (0.0123456, 0.0987654, "0.012346 .. 0.098765"),
        (2e-4 - 3e-10, 2e-4 + 3e-10, "0.0001999997 .. 0.0002000003"),
        (-1.0, 1.0, "-1 .. 1"),
        (3.0, 3.0, "3 .. 3"),
        (-inf, inf, "not determined"),
    ],
)
def test_interval(low: float, high: float, text: str) -> None:
    assert interval_text(low, high) == text


@given(st.floats(-1e6, 1e6), st.floats(1e-6, 1e6))
def test_the_ends_of_a_wide_enough_interval_differ(low: float, width: float) -> None:
    first, last = interval_text(low, low + width).split(" .. ")
    assert float(first) < float(last)
