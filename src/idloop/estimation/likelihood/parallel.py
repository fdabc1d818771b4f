"""Independent fits in parallel threads; compiled code releases the interpreter lock."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

import numpy as np

_In = TypeVar("_In")
_Out = TypeVar("_Out")

_MOST_WORKERS = 8


def workers() -> int:
    """Number of threads: one for each core that this process may use."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return max(min(cores, _MOST_WORKERS), 1)


def in_parallel(function: Callable[[_In], _Out], items: Iterable[_In]) -> Iterator[_Out]:
    """Yield ``function(item)`` in the order of the items, computed on all cores.

    The calls must be independent; floating-point warnings are off in them. An exception is raised at the place of its
    item.
    """

    # Threads of a pool do not inherit the error state.
    @np.errstate(all="ignore")
    def quietly(item: _In) -> _Out:
        return function(item)

    with ThreadPoolExecutor(workers()) as pool:
        yield from pool.map(quietly, items)
