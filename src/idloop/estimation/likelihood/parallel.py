"""Independent refits on all cores: threads, since compiled code lets others run."""

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
    """Threads that work at once: one for each core that this process may use."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return max(min(cores, _MOST_WORKERS), 1)


def in_parallel(function: Callable[[_In], _Out], items: Iterable[_In]) -> Iterator[_Out]:
    """Apply a function to items on all cores; results come in the order of the items.

    Parameters
    ----------
    function : callable
        Must not depend on what the others do. Floating-point warnings are off in it.
    items : iterable

    Yields
    ------
    object
        ``function(item)``, as soon as it and all before it are there.

    Raises
    ------
    Exception
        What the function raised, at the place of its item.
    """

    # An error state does not travel into the threads of a pool.
    @np.errstate(all="ignore")
    def quietly(item: _In) -> _Out:
        return function(item)

    with ThreadPoolExecutor(workers()) as pool:
        yield from pool.map(quietly, items)
