"""A growing store of stamped rows that forgets its oldest ones."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

BEFORE_ALL = -(1 << 63)  # older than any stamp
MOST_NEW = 256  # rows that wait to be stored together: one by one, each costs as much as its decoding


class SampleStore:
    """Rows of numbers with stamps in nanoseconds, strictly increasing.

    `columns`: numbers in a row.
    """

    def __init__(self, columns: int) -> None:
        self._stamps = np.zeros(1024, dtype=np.int64)
        self._rows = np.zeros((1024, columns))
        self._start = self._stop = 0
        self._newest = BEFORE_ALL
        self._new_stamps: list[int] = []
        self._new_rows: list[tuple[float, ...]] = []

    def __len__(self) -> int:
        return self._stop - self._start + len(self._new_stamps)

    def append(self, stamp: int, row: tuple[float, ...]) -> None:
        """Add a row; one that is not newer than the last is left out."""
        if stamp <= self._newest:
            return
        self._newest = stamp
        self._new_stamps.append(stamp)
        self._new_rows.append(row)
        if len(self._new_stamps) == MOST_NEW:
            self._store_new()

    def _store_new(self) -> None:
        count = len(self._new_stamps)
        if not count:
            return
        if self._stop + count > len(self._stamps):
            self._make_room(count)
        part = slice(self._stop, self._stop + count)
        self._stamps[part], self._rows[part] = self._new_stamps, self._new_rows
        self._stop += count
        self._new_stamps, self._new_rows = [], []

    def window(self, first: int, last: int, before: bool = False) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Return copies of stamps (n,) and rows (n, c) with first <= stamp < last.

        `first`, `last`: nanoseconds; `before`: include the row before the window: a held value reaches into it.
        """
        self._store_new()
        stamps = self._stamps[self._start : self._stop]
        low = int(np.searchsorted(stamps, first))
        if before and low > 0 and (low == len(stamps) or stamps[low] > first):
            low -= 1
        part = slice(self._start + low, self._start + int(np.searchsorted(stamps, last)))
        return self._stamps[part].copy(), self._rows[part].copy()

    def take_back(self, stamp: int) -> None:
        """Drop rows from `stamp` on: their sender has announced them again."""
        if stamp > self._newest:
            return
        self._store_new()
        stamps = self._stamps[self._start : self._stop]
        self._stop = self._start + int(np.searchsorted(stamps, stamp))
        self._newest = int(self._stamps[self._stop - 1]) if self._stop > self._start else BEFORE_ALL

    def forget(self, before: int) -> None:
        """Drop rows older than `before`, all but one: a held value stays known."""
        self._store_new()
        stamps = self._stamps[self._start : self._stop]
        self._start += max(0, int(np.searchsorted(stamps, before)) - 1)

    def clear(self) -> None:
        """Drop everything."""
        self._start = self._stop = 0
        self._newest = BEFORE_ALL
        self._new_stamps, self._new_rows = [], []

    def _make_room(self, count: int) -> None:
        size = self._stop - self._start
        stamps, rows = self._stamps, self._rows
        if size + count > len(stamps) // 2:
            room = 2 * max(len(stamps), count)
            self._stamps = np.zeros(room, dtype=np.int64)
            self._rows = np.zeros((room, rows.shape[1]))
        self._stamps[:size] = stamps[self._start : self._stop]
        self._rows[:size] = rows[self._start : self._stop]
        self._start, self._stop = 0, size
