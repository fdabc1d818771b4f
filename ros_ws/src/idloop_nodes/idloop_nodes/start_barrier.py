"""How long a node waits for the others at the start, and what it reports about them."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from idloop.errors import IdloopError

# A running peer may need minutes before it is ready: on the first start it compiles.
RUNNING_PEER_FACTOR = 20.0
NOTICE = 10.0  # seconds after which a node reports for whom it waits; then whenever that has changed


class StartBarrier:
    """Watches the time that the other nodes of a graph take to get ready.

    `peers`: their names. `limit`: longest wait for one that does not appear [s]; a running one has
    `RUNNING_PEER_FACTOR` times as long. `born`: beginning of the wait, of a clock that never jumps [s].
    """

    def __init__(self, peers: Sequence[str], limit: float, born: float) -> None:
        self._peers = tuple(peers)
        self._limit = limit
        self._born = born
        self._reported = ""

    def notice(self, ready: Collection[str], running: Collection[str], unconnected: Sequence[str], now: float) -> str:
        """Return for whom the node waits when that has changed; else nothing.

        `ready`, `running`: names of the nodes that are ready, and of those that run; `unconnected`: streams of this
        node that are not connected to all of their partners; `now`: time [s]. Raises IdloopError: the time limit is
        over.
        """
        late = [name for name in self._peers if name not in ready]
        absent = [name for name in late if name not in running]
        compiling = [name for name in late if name in running]
        waited = now - self._born
        if absent and waited > self._limit:
            raise IdloopError(
                f"{', '.join(absent)} did not appear within {self._limit:g} s (parameter start_timeout); check the "
                "parameter peers, the names of the nodes, and that all of them run in one ROS domain and namespace"
            )
        what = "; ".join(
            f"{', '.join(names)} {state}"
            for names, state in (
                (absent, "not there yet"),
                (compiling, "there, not ready (a first start compiles)"),
                ([] if late else unconnected, "not connected with all who are there"),
            )
            if names
        )
        longest = RUNNING_PEER_FACTOR * self._limit
        if waited > longest:
            raise IdloopError(f"gave up after {longest:g} s (20 times start_timeout): {what or 'nobody is ready'}")
        if waited < NOTICE or what in ("", self._reported):
            return ""
        self._reported = what
        return f"waits: {what}"
