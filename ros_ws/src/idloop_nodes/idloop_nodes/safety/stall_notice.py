"""When to report that a loop stands still, and once only."""

from __future__ import annotations

from collections.abc import Hashable

TIMEOUT = 20.0  # seconds without a step; a fit of all data may take as long
FIRST_TIMEOUT = 5.0  # seconds without a confirmation of the first sample


class StallNotice:
    """Notes what a node waits for."""

    def __init__(self) -> None:
        self._what: Hashable = None
        self._since = 0.0
        self._reported = False

    def due(self, what: Hashable, now: float, timeout: float | None = None) -> bool:
        """Whether it is time to report a wait that was not reported yet.

        `what`: what the node waits for; another one begins a new wait, None ends it. `now`: of a clock that never jumps
        [s]. `timeout`: length of a wait that is not reported [s]; default `TIMEOUT`.
        """
        if what != self._what:
            self._what, self._since, self._reported = what, now, False
        if what is None or self._reported or now - self._since < (TIMEOUT if timeout is None else timeout):
            return False
        self._reported = True
        return True
