"""The page's orders as service calls: nobody waits, and every order is answered or given up in words."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from rcl_interfaces.msg import ParameterType
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger

PATIENCE = 30.0  # seconds within which a node has to be there and answer, on a machine that does other work as well

Answered = Callable[[bool, str], None]


class Calls:
    """Service clients of one node.

    Parameters
    ----------
    node : rclpy.node.Node
    """

    def __init__(self, node: Any) -> None:
        self._node = node
        self._clients: dict[str, Any] = {}
        self._waiting: list[_Call] = []

    def expect(self, *triggers: str) -> None:
        """Look for std_srvs/Trigger services before they are needed: to find one takes seconds on a busy machine."""
        for service in triggers:
            self._client(Trigger, service)

    def trigger(self, service: str, answered: Answered, patience: float | None = None) -> None:
        """Call a std_srvs/Trigger; `answered` receives success and message, after `patience` seconds at the latest."""
        self._begin(Trigger, service, Trigger.Request(), lambda r: answered(r.success, r.message), answered, patience)

    def add_effect(self, node: str, effect: str, answered: Answered) -> None:
        """Add an effect to the parameter `effects` of a node."""

        def known(response: Any) -> None:
            value = response.values[0]
            effects = [one for one in value.string_array_value if one]
            if value.type not in (ParameterType.PARAMETER_STRING_ARRAY, ParameterType.PARAMETER_NOT_SET):
                answered(False, f"node {node} has no parameter effects")
            elif effect in effects:
                answered(False, f"the model has {effect} already")
            else:
                more = [*effects, effect]
                self.set_parameter(node, "effects", more, f"refitting with {', '.join(more)}", answered)

        request = GetParameters.Request(names=["effects"])
        self._begin(GetParameters, f"{node}/get_parameters", request, known, answered)

    def set_parameter(self, node: str, name: str, value: bool | list[str], said: str, answered: Answered) -> None:
        """Set a parameter of a node; `answered` receives the reason of a refusal, else what is `said`."""
        request = SetParameters.Request(parameters=[Parameter(name, value=value).to_parameter_msg()])

        def taken(response: Any) -> None:
            result = response.results[0]
            answered(result.successful, result.reason or said)

        self._begin(SetParameters, f"{node}/set_parameters", request, taken, answered)

    def poll(self) -> None:
        """Send what had to wait for its server, give up on what is not answered."""
        now = time.monotonic()
        for call in list(self._waiting):
            if call.finished:
                self._waiting.remove(call)
            elif now > call.limit:
                self._waiting.remove(call)
                call.finished = True
                call.refused(False, f"{call.service} does not answer: is that node in this graph?")
            elif not call.sent and self._clients[call.service].service_is_ready():
                self._send(call)

    def _client(self, kind: Any, service: str) -> None:
        if service not in self._clients:
            self._clients[service] = self._node.create_client(kind, service)

    def _begin(
        self,
        kind: Any,
        service: str,
        request: Any,
        done: Callable[[Any], None],
        refused: Answered,
        patience: float | None = None,
    ) -> None:
        self._client(kind, service)
        limit = time.monotonic() + (PATIENCE if patience is None else patience)
        self._waiting.append(_Call(service, request, done, refused, limit))
        self.poll()

    def _send(self, call: _Call) -> None:
        call.sent = True

        def arrived(future: Any) -> None:
            if not call.finished:
                call.finished = True
                call.done(future.result())

        self._clients[call.service].call_async(call.request).add_done_callback(arrived)


class _Call:
    """One call under way."""

    def __init__(
        self, service: str, request: Any, done: Callable[[Any], None], refused: Answered, limit: float
    ) -> None:
        self.service = service
        self.request = request
        self.done = done
        self.refused = refused
        self.limit = limit
        self.sent = False
        self.finished = False
