"""Service calls that never block, and what is ordered by them: an experiment, its end, another effect."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.parameter import Parameter, parameter_value_to_python
from std_srvs.srv import Trigger

from idloop_nodes.estimation.diagnosis_jobs import MotionLimits

TIMEOUT = 30.0  # seconds within which a node has to be there and answer, on a machine that does other work as well
EXPERIMENT_TIMEOUT = 10.0  # seconds likewise, for what concerns an experiment
LIMITS = ("amplitude", "position_min", "position_max", "velocity")

Answered = Callable[[bool, str], None]
Refused = Callable[[str], None]


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


class ServiceCalls:
    """Service clients of one node; every call is answered, or given up with a reason after `timeout` [s]."""

    def __init__(self, node: Any, timeout: float = TIMEOUT) -> None:
        self._node = node
        self._timeout = timeout
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
        self, node: str, names: Sequence[str], done: Callable[[list[Any]], None], refused: Answered
    ) -> None:
        """Ask for parameters of a node; `done` receives a value or None for each name."""
        request = GetParameters.Request(names=list(names))

        def taken(response: Any) -> None:
            values = [parameter_value_to_python(value) for value in response.values]
            done(values + [None] * (len(names) - len(values)))

        self._begin(GetParameters, f"{node}/get_parameters", request, taken, refused)

    def set_parameter(self, node: str, name: str, value: Any, message: str, answered: Answered) -> None:
        """Set a parameter of a node; `answered` receives the reason of a refusal, else `message`."""
        request = SetParameters.Request(parameters=[Parameter(name, value=value).to_parameter_msg()])

        def taken(response: Any) -> None:
            result = response.results[0]
            answered(result.successful, result.reason or message)

        self._begin(SetParameters, f"{node}/set_parameters", request, taken, answered)

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
        timeout: float | None = None,
    ) -> None:
        self._client(kind, service)
        limit = time.monotonic() + (self._timeout if timeout is None else timeout)
        self._waiting.append(_Call(service, request, done, refused, limit))
        self.poll()

    def _send(self, call: _Call) -> None:
        call.sent = True

        def arrived(future: Any) -> None:
            if not call.finished:  # an answer after the call was given up is ignored
                call.finished = True
                call.done(future.result())

        self._clients[call.service].call_async(call.request).add_done_callback(arrived)


class ExperimentClient:
    """Hands experiments over to the excitation node of a name, by its parameters and one service."""

    def __init__(self, node: Any, excitation: str) -> None:
        self._name = excitation
        self.calls = ServiceCalls(node, EXPERIMENT_TIMEOUT)
        self.calls.expect(f"{excitation}/run_experiment")

    def ask_limits(self, done: Callable[[MotionLimits], None], refused: Refused) -> None:
        """Ask what an experiment may do."""

        def answered(values: list[Any]) -> None:
            target, *limits = values
            if target is None:
                refused(f"node {self._name} has no parameter target: it is no excitation of idloop")
                return
            amplitude, low, high, velocity = (float(one) if isinstance(one, int | float) else None for one in limits)
            adds_to = "command" if target == "effort" else "reference"
            done(MotionLimits(amplitude, low, high, velocity, adds_to, target == "reference"))

        names = ["target", *(f"limit.{name}" for name in LIMITS)]
        self.calls.get_parameters(self._name, names, answered, lambda _, reason: refused(reason))

    def run(self, experiment: str, done: Callable[[str], None], refused: Refused) -> None:
        """Hand an experiment over and start it."""

        def then(go_on: Callable[[str], None]) -> Answered:
            return lambda success, text: go_on(text) if success else refused(f"{self._name}: {text}")

        def start(_: str) -> None:
            self.calls.trigger(f"{self._name}/run_experiment", then(done))

        self.calls.set_parameter(self._name, "experiment", experiment, "", then(start))


class ExperimentEnd:
    """Stops the motor and the excitation at the end of an experiment, as a user does, without waiting for them."""

    def __init__(self, node: Any, guards: Sequence[str], excitation: str, warn: Callable[[str], object]) -> None:
        self._calls, self._warn = ServiceCalls(node, EXPERIMENT_TIMEOUT), warn
        # The guards are in the order of their distance from the motor.
        self._services = (*(f"{guard}/emergency_stop" for guard in guards), f"{excitation}/stop")
        self._waiting: set[str] = set()
        self.poll = self._calls.poll

    @property
    def busy(self) -> bool:
        """Whether an answer is still to come."""
        return bool(self._waiting)

    def end(self) -> None:
        """Call all of them at once."""
        self._waiting = set(self._services)
        for service in self._services:
            self._calls.trigger(service, partial(self._answered, service))

    def _answered(self, service: str, done: bool, text: str) -> None:
        self._waiting.discard(service)
        if not done:
            self._warn(f"the experiment was to end, but {service}: {text}")
