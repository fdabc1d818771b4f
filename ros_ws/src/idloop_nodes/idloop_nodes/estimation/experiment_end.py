"""How the estimator ends an experiment: by the services with which a user stops the graph."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

from idloop_nodes.service_calls import ServiceCalls

TIMEOUT = 10.0  # seconds within which a node has to answer


class ExperimentEnd:
    """Stops the motor and the excitation, without waiting for them.

    `guards`: nodes with the service ``~/emergency_stop``, the nearest to the motor first; `excitation`: node with the
    service ``~/stop``; `warn`: receives one line when a node refuses or does not answer.
    """

    def __init__(
        self, calls: ServiceCalls, guards: Sequence[str], excitation: str, warn: Callable[[str], object]
    ) -> None:
        self._calls, self._warn = calls, warn
        self._services = (*(f"{guard}/emergency_stop" for guard in guards), f"{excitation}/stop")
        self._waiting: set[str] = set()

    @property
    def busy(self) -> bool:
        """Whether an answer is still to come."""
        return bool(self._waiting)

    def end(self) -> None:
        """Call all of them at once."""
        self._waiting = set(self._services)
        for service in self._services:
            self._calls.trigger(service, partial(self._answered, service), TIMEOUT)

    def poll(self) -> None:
        """Send what had to wait for its server, give up on what is not answered."""
        self._calls.poll()

    def _answered(self, service: str, done: bool, text: str) -> None:
        self._waiting.discard(service)
        if not done:
            self._warn(f"the experiment was to end, but {service}: {text}")
