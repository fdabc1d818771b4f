"""Orders are carried out one after the other; one may wait for that which is under way."""

from __future__ import annotations

import threading

import pytest

from idloop.errors import InputError
from idloop.reporting.workbench.coordinator import Coordinator
from idloop.reporting.workbench.state import Snapshot, State


def test_a_search_waits_for_the_comparison_and_no_third_order_is_taken():
    state, free, done = State(Snapshot()), threading.Event(), []
    coordinator = Coordinator(state, yields=False)
    finished = threading.Event()

    def search():
        done.append(state.snapshot.activity.text)
        finished.set()

    try:
        coordinator.order("comparing", lambda: free.wait(10.0))
        with pytest.raises(InputError, match="comparing is under way"):
            coordinator.order("adding", lambda: None)
        with pytest.raises(InputError, match="comparing is under way"):  # nothing waits for itself
            coordinator.order("comparing", lambda: None, waits=True)
        coordinator.order("searching", search, waits=True)
        assert state.snapshot.activity.then == "searching"
        with pytest.raises(InputError, match="under way"):
            coordinator.order("searching again", search, waits=True)
        free.set()
        assert finished.wait(10.0)
        assert done == ["searching"]
    finally:
        free.set()
        coordinator.close()
    assert coordinator.busy == ""
    assert state.snapshot.activity is None
