"""Stamped rows: stored, cut, forgotten."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")

from idloop_nodes.streams.sample_buffer import SampleStore


@given(st.lists(st.integers(1, 40), min_size=1, max_size=3000), st.integers(0, 500), st.integers(0, 2000))
def test_sample_store_gives_what_was_stored(steps, width, start):
    stamps = np.cumsum(steps)
    store = SampleStore(1)
    for stamp in stamps:
        store.append(int(stamp), (float(stamp),))
    got, rows = store.window(start, start + width)
    inside = stamps[(stamps >= start) & (stamps < start + width)]
    assert got.tolist() == inside.tolist() == rows[:, 0].tolist()


def test_sample_store_forgets_but_keeps_the_held_value():
    store = SampleStore(1)
    for stamp in range(0, 5000, 10):
        store.append(stamp, (float(stamp),))
        store.forget(stamp - 100)
    assert len(store) <= 12
    stamps, _ = store.window(4905, 4921, before=True)
    assert stamps.tolist() == [4900, 4910, 4920]


def test_sample_store_leaves_repeated_stamps_out():
    store = SampleStore(1)
    for stamp, value in ((1, 1.0), (1, 2.0), (0, 3.0), (2, 4.0)):
        store.append(stamp, (value,))
    assert store.window(0, 9)[1][:, 0].tolist() == [1.0, 4.0]


@given(st.lists(st.tuples(st.sampled_from(["append", "take_back", "forget"]), st.integers(0, 400)), max_size=60))
def test_sample_store_does_as_a_list_would(orders):
    store, plain = SampleStore(1), []
    for verb, stamp in orders:
        getattr(store, verb)(*((stamp, (float(stamp),)) if verb == "append" else (stamp,)))
        if verb == "append" and (not plain or stamp > plain[-1]):
            plain.append(stamp)
        elif verb == "take_back":
            plain = [one for one in plain if one < stamp]
        elif verb == "forget":
            plain = plain[max(0, sum(one < stamp for one in plain) - 1) :]
    assert len(store) == len(plain)
    assert store.window(0, 500)[0].tolist() == plain
