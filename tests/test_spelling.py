"""Names in an error line: the nearest one, not too many, and none that spoils the line."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from idloop.spelling import did_you_mean, listed


def test_the_nearest_name_is_offered():
    assert did_you_mean("dead_zon", ["backlash", "dead_zone"]) == " (did you mean 'dead_zone'?)"
    assert did_you_mean("nothing", ["backlash", "dead_zone"]) == ""


def test_many_names_are_counted():
    assert listed("abc") == "a, b, c"
    assert listed([], 3) == "none"
    assert listed("abcdef", 2) == "a, b, ... (6 in all)"


@given(st.lists(st.text(max_size=300)))
def test_whatever_a_file_calls_its_columns_stays_one_printable_line(names):
    text = listed(names)
    assert text.isprintable()
    assert len(text) < 12 * 900
