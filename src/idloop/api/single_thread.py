"""Linear algebra in one thread for as long as a function of the library runs."""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

from idloop.worker_process import ONE_THREAD

P = ParamSpec("P")
T = TypeVar("T")


def single_threaded(function: Callable[P, T]) -> Callable[P, T]:
    """Run a function with one thread for linear algebra.

    The matrices are small, and the library has threads of its own: where the threads of BLAS wait for a busy core, the
    exponential of a 4 × 4 matrix takes 10 ms instead of 20 µs.
    """

    @wraps(function)
    def limited(*args: P.args, **kwargs: P.kwargs) -> T:
        if all(os.environ.get(name) == "1" for name in ONE_THREAD):
            return function(*args, **kwargs)
        # Imported on first use, for a quick start of the command line.
        from threadpoolctl import threadpool_limits

        with threadpool_limits(limits=1, user_api="blas"):
            return function(*args, **kwargs)

    return limited
