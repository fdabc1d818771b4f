"""Functions of the library keep linear algebra to one thread, and leave the setting of the caller as it was."""

from __future__ import annotations

import pytest
from threadpoolctl import threadpool_info, threadpool_limits

import idloop
from idloop.api.single_thread import single_threaded
from idloop.worker_process import ONE_THREAD


def _threads() -> set[int]:
    return {one["num_threads"] for one in threadpool_info() if one["user_api"] == "blas"}


@pytest.fixture
def several(monkeypatch):
    """Linear algebra in two threads."""
    for name in ONE_THREAD:
        monkeypatch.delenv(name, raising=False)
    with threadpool_limits(limits=2, user_api="blas"):
        yield _threads()


def test_linear_algebra_has_one_thread_inside(several):
    inside = single_threaded(_threads)()
    assert inside == {1}
    assert _threads() == several


@pytest.mark.parametrize("name", ["fit", "identify", "compare", "diagnose", "refine", "suggest"])
def test_long_functions_are_single_threaded(name):
    assert hasattr(getattr(idloop, name), "__wrapped__")
