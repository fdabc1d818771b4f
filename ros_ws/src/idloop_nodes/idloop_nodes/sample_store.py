"""A growing store of stamped rows that forgets its oldest ones."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


class SampleStore:
    """Rows of numbers with stamps in nanoseconds, strictly increasing.

    Parameters
    ----------
    columns : int
        Numbers in a row.
    """

    def __init__(self, columns: int) -> None:
        self._stamps = np.zeros(1024, dtype=np.int64)
        self._rows = np.zeros((1024, columns))
        self._start = self._stop = 0

    def __len__(self) -> int:
        return self._stop - self._start

    def append(self, stamp: int, row: tuple[float, ...]) -> None:
        """Add a row; one that is not newer than the last is left out."""
        if self._stop > self._start and stamp <= self._stamps[self._stop - 1]:
            return
        if self._stop == len(self._stamps):
            self._make_room()
        self._stamps[self._stop] = stamp
        self._rows[self._stop] = row
        self._stop += 1

    def window(self, first: int, last: int, before: bool = False) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Return copies of stamps (n,) and rows (n, c) with first <= stamp < last.

        Parameters
        ----------
        first, last : int
            Nanoseconds.
        before : bool
            Include the row before the window: a held value reaches into it.
        """
        stamps = self._stamps[self._start : self._stop]
        low = int(np.searchsorted(stamps, first))
        if before and low > 0 and (low == len(stamps) or stamps[low] > first):
            low -= 1
        part = slice(self._start + low, self._start + int(np.searchsorted(stamps, last)))
        return self._stamps[part].copy(), self._rows[part].copy()

    def take_back(self, stamp: int) -> None:
        """Drop rows from `stamp` on: their sender has announced them anew."""
        if self._stop == self._start or stamp > self._stamps[self._stop - 1]:
            return
        stamps = self._stamps[self._start : self._stop]
        self._stop = self._start + int(np.searchsorted(stamps, stamp))

    def forget(self, before: int) -> None:
        """Drop rows older than `before`, all but one: a held value stays known."""
        stamps = self._stamps[self._start : self._stop]
        self._start += max(0, int(np.searchsorted(stamps, before)) - 1)

    def clear(self) -> None:
        """Drop everything."""
        self._start = self._stop = 0

    def _make_room(self) -> None:
        size = len(self)
        stamps, rows = self._stamps, self._rows
        if size > len(stamps) // 2:
            self._stamps = np.zeros(2 * len(stamps), dtype=np.int64)
            self._rows = np.zeros((2 * len(stamps), rows.shape[1]))
        self._stamps[:size] = stamps[self._start : self._stop]
        self._rows[:size] = rows[self._start : self._stop]
        self._start, self._stop = 0, size
