"""The services that stop a motor and let it go again."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from std_srvs.srv import Trigger

STOPPED = "stopped until ~/reset"


class EmergencyStop:
    """``~/emergency_stop``, latched, and ``~/reset``.

    `node`: node that offers them. `lock`: held while one of them is served. `stop`: stops the motor at once. `reset`:
    clears stop and faults; returns why that cannot be done, empty when it was. `done`: message of a successful reset.
    Attributes: `latched`: ``emergency stop`` until reset, else empty.
    """

    def __init__(
        self, node: Any, lock: threading.Lock, stop: Callable[[], None], reset: Callable[[], str], done: str
    ) -> None:
        self.latched = ""
        self._node = node
        self._lock = lock
        self._stop = stop
        self._reset = reset
        self._done = done
        node.create_service(Trigger, "~/emergency_stop", self._on_emergency_stop)
        node.create_service(Trigger, "~/reset", self._on_reset)

    def _on_emergency_stop(self, request: Any, response: Any) -> Any:
        with self._lock:
            self.latched = "emergency stop"
            self._stop()
        self._node.get_logger().warning(f"emergency stop: {STOPPED}")
        response.success, response.message = True, STOPPED
        return response

    def _on_reset(self, request: Any, response: Any) -> Any:
        with self._lock:
            refused = self._reset()
            if not refused:
                self.latched = ""
        response.success, response.message = not refused, refused or self._done
        return response
