"""Values that hold from their stamp on."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")

from idloop_nodes.streams.held_stream import HeldStream


@given(st.lists(st.tuples(st.integers(0, 50), st.floats(allow_nan=False)), min_size=1), st.integers(0, 60))
def test_held_stream_is_the_newest_value_not_after_the_question(items, when):
    ordered = sorted(dict(items).items())
    stream = HeldStream()
    for stamp, value in ordered:
        stream.push(stamp, (value,))
    wanted = [(stamp, (value,)) for stamp, value in ordered if stamp <= when]
    assert stream.covers(when) == (ordered[-1][0] >= when)
    assert stream.at(when) == (wanted[-1] if wanted else None)


def test_held_stream_takes_announced_values_back():
    stream = HeldStream()
    for stamp in (10, 20, 30):
        stream.push(stamp, (float(stamp),))
    stream.push(20, (0.0,))
    assert stream.at(40) == (20, (0.0,))
    assert stream.newest == 20
