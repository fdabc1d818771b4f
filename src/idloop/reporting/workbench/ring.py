"""The newest samples of a stream in a fixed piece of memory."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from idloop.arrays import Array

Stamps = NDArray[np.int64]

SPARE = 8  # part of the samples that are kept, as which there is room for more of them


class Ring:
    """Keeps the newest samples by stamp; what is older is forgotten.

    The arrays are longer than what is kept by a part of it: a window is then one contiguous view, and samples move
    only when that part is full. `drawn`: they are drawn and no more: in the precision in which a browser gets them,
    half the memory.
    """

    def __init__(self, columns: int, capacity: int, *, drawn: bool = False) -> None:
        self.capacity = max(int(capacity), 1)
        self._room = self.capacity + -(-self.capacity // SPARE)
        self._stamps: Stamps = np.empty(self._room, dtype=np.int64)
        self._values: Array = np.empty((self._room, columns), dtype=np.float32 if drawn else float)
        self._first = self._end = 0

    def __len__(self) -> int:
        return self._end - self._first

    @property
    def nbytes(self) -> int:
        """Memory that the samples take, however many there are [B]."""
        return self._stamps.nbytes + self._values.nbytes

    @property
    def newest(self) -> int | None:
        """Stamp of the newest sample [ns]; None when there is none."""
        return int(self._stamps[self._end - 1]) if len(self) else None

    @property
    def oldest(self) -> int | None:
        """Stamp of the oldest sample that is kept [ns]."""
        return int(self._stamps[self._first]) if len(self) else None

    def clear(self) -> None:
        """Forget everything."""
        self._first = self._end = 0

    def extend(self, stamps: ArrayLike, values: ArrayLike) -> int:
        """Take in samples with stamps [ns] newer than the newest; the number of those taken in."""
        new: Stamps = np.asarray(stamps, dtype=np.int64).reshape(-1)
        rows: Array = np.asarray(values, dtype=float).reshape(len(new), self._values.shape[1])
        if not len(new):
            return 0
        before = self.newest if self.newest is not None else int(new[0]) - 1
        # Newer than everything before it, the block's own samples included.
        keep = new > np.maximum.accumulate(np.concatenate([[before], new[:-1]]))
        new, rows = new[keep][-self.capacity :], rows[keep][-self.capacity :]
        if self._end + len(new) > self._room:
            kept = max(self.capacity - len(new), 0)
            start = max(self._end - kept, self._first)
            count = self._end - start
            self._stamps[:count] = self._stamps[start : self._end]
            self._values[:count] = self._values[start : self._end]
            self._first, self._end = 0, count
        self._stamps[self._end : self._end + len(new)] = new
        self._values[self._end : self._end + len(new)] = rows
        self._end += len(new)
        self._first = max(self._first, self._end - self.capacity)
        return int(np.sum(keep))

    def window(self, start: int, stop: int, *, before: bool = False) -> tuple[Stamps, Array]:
        """Return copies of the samples from `start` to before `stop` [ns].

        `before`: include the last sample before `start`, which still holds there.
        """
        stamps = self._stamps[self._first : self._end]
        low, high = (int(i) for i in np.searchsorted(stamps, [start, stop]))
        if before and low > 0 and (low == len(stamps) or stamps[low] > start):
            low -= 1
        low, high = self._first + low, self._first + max(high, low)
        return self._stamps[low:high].copy(), self._values[low:high].copy()
