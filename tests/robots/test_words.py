"""Tables of an identified robot."""

from __future__ import annotations

from idloop.robots.words import link_table


def test_a_centre_that_is_zero_has_no_sign():
    document = {"links": {"base": {"mass": 4.0, "centre": [-1e-9, 0.0, 0.0801]}}}
    assert [tuple(row) for row in link_table(document).rows] == [("base", "4", "0", "0", "0.0801")]
