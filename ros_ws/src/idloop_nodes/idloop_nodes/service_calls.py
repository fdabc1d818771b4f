"""Service calls that never block: every call is answered, or given up with a reason."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from rcl_interfaces.msg import ParameterType
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger

TIMEOUT = 30.0  # seconds within which a node has to be there and answer, on a machine that does other work as well

Answered = Callable[[bool, str], None]


class ServiceCalls:
    """Service clients of one node."""

    def __init__(self, node: Any) -> None:
        self._node = node
        self._clients: dict[str, Any] = {}
        self._waiting: list[_Call] = []

    @property
    def busy(self) -> bool:
        """Whether an answer is still to come."""
        return any(not call.finished for call in self._waiting)

    def expect(self, *triggers: str) -> None:
        """Look for std_srvs/Trigger services before they are needed: discovery takes seconds on a busy machine."""
        for service in triggers:
            self._client(Trigger, service)

    def trigger(self, service: str, answered: Answered, timeout: float | None = None) -> None:
        """Call a std_srvs/Trigger; `answered` receives success and message, after `timeout` seconds at the latest."""
        request = Trigger.Request()
        self._begin(Trigger, service, request, lambda one: answered(one.success, one.message), answered, timeout)

    def get_parameters(
        self,
        node: str,
        names: Sequence[str],
        done: Callable[[list[Any]], None],
        refused: Answered,
        timeout: float | None = None,
    ) -> None:
        """Ask for parameters of a node; `done` receives a number, text, list of texts or None for each name."""
        request = GetParameters.Request(names=list(names))

        def taken(response: Any) -> None:
            values = [_plain(value) for value in response.values]
            done(values + [None] * (len(names) - len(values)))

        self._begin(GetParameters, f"{node}/get_parameters", request, taken, refused, timeout)

    def set_parameter(
        self, node: str, name: str, value: Any, message: str, answered: Answered, timeout: float | None = None
    ) -> None:
        """Set a parameter of a node; `answered` receives the reason of a refusal, else `message`."""
        request = SetParameters.Request(parameters=[Parameter(name, value=value).to_parameter_msg()])

        def taken(response: Any) -> None:
            result = response.results[0]
            answered(result.successful, result.reason or message)

        self._begin(SetParameters, f"{node}/set_parameters", request, taken, answered, timeout)

    def add_effect(self, node: str, effect: str, answered: Answered) -> None:
        """Add an effect to the parameter `effects` of a node."""

        def known(values: list[Any]) -> None:
            effects = [one for one in values[0] or () if one]
            if effect in effects:
                answered(False, f"the model has {effect} already")
            else:
                more = [*effects, effect]
                self.set_parameter(node, "effects", more, f"refitting with {', '.join(more)}", answered)

        self.get_parameters(node, ["effects"], known, answered)

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
        timeout: float | None,
    ) -> None:
        self._client(kind, service)
        limit = time.monotonic() + (TIMEOUT if timeout is None else timeout)
        self._waiting.append(_Call(service, request, done, refused, limit))
        self.poll()

    def _send(self, call: _Call) -> None:
        call.sent = True

        def arrived(future: Any) -> None:
            if not call.finished:  # an answer after the call was given up is ignored
                call.finished = True
                call.done(future.result())

        self._clients[call.service].call_async(call.request).add_done_callback(arrived)


@dataclass(eq=False)
class _Call:
    """One call that is under way."""

    service: str
    request: Any
    done: Callable[[Any], None]
    refused: Answered
    limit: float
    sent: bool = False
    finished: bool = False


def _plain(value: Any) -> float | str | list[str] | None:
    """Return a parameter's value in its plain type; None for any other."""
    if value.type == ParameterType.PARAMETER_DOUBLE:
        return float(value.double_value)
    if value.type == ParameterType.PARAMETER_INTEGER:
        return float(value.integer_value)
    if value.type == ParameterType.PARAMETER_STRING:
        return str(value.string_value)
    if value.type == ParameterType.PARAMETER_STRING_ARRAY:
        return list(value.string_array_value)
    return None
