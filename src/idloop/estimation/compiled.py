"""How functions are compiled that only compiled functions call."""

from __future__ import annotations

from numba import njit

# Nothing is made for a call from Python, and no file of its own in the cache: the caller's contains it.
seldom = njit(nogil=True, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)
# For loops that take less time than a call.
inner = njit(nogil=True, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True, forceinline=True)
