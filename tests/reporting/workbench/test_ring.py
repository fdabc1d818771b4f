"""A ring holds the newest samples, in order, in memory that does not grow."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from idloop.reporting.workbench.ring import Ring

BLOCKS = st.lists(st.lists(st.integers(0, 400), max_size=30), max_size=12)


@given(BLOCKS, st.integers(1, 40))
def test_it_holds_the_newest_rising_stamps_and_no_more_than_its_capacity(blocks, capacity):
    ring = Ring(2, capacity)
    memory = ring.nbytes
    kept: list[int] = []
    for block in blocks:
        for stamp in block:
            if not kept or stamp > kept[-1]:
                kept.append(stamp)
        ring.extend(block, np.repeat(np.array(block, dtype=float)[:, None], 2, axis=1))
    kept = kept[-capacity:]
    stamps, values = ring.window(-1, 1000)
    assert stamps.tolist() == kept
    assert values.tolist() == [[float(s), float(s)] for s in kept]
    assert len(ring) == len(kept)
    assert (ring.oldest, ring.newest) == ((kept[0], kept[-1]) if kept else (None, None))
    assert ring.nbytes == memory


@given(st.sets(st.integers(0, 100), min_size=1), st.integers(-5, 105), st.integers(0, 50))
def test_a_window_is_half_open_and_may_begin_with_the_value_that_still_holds(stamps, start, length):
    ring = Ring(1, 200)
    ordered = sorted(stamps)
    ring.extend(ordered, np.array(ordered, dtype=float)[:, None])
    inside = [s for s in ordered if start <= s < start + length]
    assert ring.window(start, start + length)[0].tolist() == inside
    held = [s for s in ordered if s < start][-1:] if start not in ordered else []
    assert ring.window(start, start + length, before=True)[0].tolist() == held + inside


def test_clearing_forgets():
    ring = Ring(1, 3)
    ring.extend([1, 2], [[1.0], [2.0]])
    ring.clear()
    assert len(ring) == 0
    assert ring.extend([1], [[5.0]]) == 1


def test_there_is_little_more_room_than_for_what_is_kept():
    ring = Ring(12, 8000)
    assert ring.nbytes <= 8000 * (12 + 1) * 8 * 9 / 8
