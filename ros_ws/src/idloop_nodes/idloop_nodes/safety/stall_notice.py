"""When to say that a loop has come to a stand, and once only."""

from __future__ import annotations

from collections.abc import Hashable

PATIENCE = 20.0  # seconds without a step; a fit of everybody's data may take as long
FIRST = 5.0  # seconds without a sign that the first sample has arrived


class StallNotice:
    """Notes what a node waits for."""

    def __init__(self) -> None:
        self._what: Hashable = None
        self._since = 0.0
        self._told = False

    def due(self, what: Hashable, now: float, patience: float = PATIENCE) -> bool:
        """Whether it is time to say that the node waits, which it has not said yet.

        Parameters
        ----------
        what : hashable
            What it waits for; another one begins a new wait, None ends it.
        now : float
            Of a clock that never jumps [s].
        patience : float
            How long a wait is not worth a word [s].
        """
        if what != self._what:
            self._what, self._since, self._told = what, now, False
        if what is None or self._told or now - self._since < patience:
            return False
        self._told = True
        return True
