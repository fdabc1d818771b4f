"""How the estimator hands an experiment over to the excitation node: parameters and one service, nothing of our own."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import GetParameters, SetParameters
from std_srvs.srv import Trigger

from idloop_nodes.estimation.diagnosis_jobs import MotionLimits

PATIENCE = 10.0  # seconds within which the excitation node has to answer
LIMITS = ("amplitude", "position_min", "position_max", "velocity")
NAMES = ("target", "signal", *(f"limit.{name}" for name in LIMITS))

Refused = Callable[[str], None]


class ExperimentClient:
    """Talks to the excitation node without waiting for it.

    Parameters
    ----------
    node : rclpy.node.Node
    excitation : str
        Name of the excitation node.
    """

    def __init__(self, node: Any, excitation: str) -> None:
        self._name = excitation
        self._get = node.create_client(GetParameters, f"{excitation}/get_parameters")
        self._set = node.create_client(SetParameters, f"{excitation}/set_parameters")
        self._run = node.create_client(Trigger, f"{excitation}/run_experiment")
        self._waiting: tuple[float, Callable[[], None] | None, Refused] | None = None

    @property
    def busy(self) -> bool:
        """Whether an answer is still to come."""
        return self._waiting is not None

    def ask_limits(self, done: Callable[[MotionLimits], None], refused: Refused) -> None:
        """Ask what an experiment may do."""

        def send() -> None:
            self._call(self._get, GetParameters.Request(names=list(NAMES)), answered)

        def answered(response: Any) -> None:
            values = dict(zip(NAMES, (_plain(one) for one in response.values), strict=False))
            if values.get("target") is None:
                self._end(refused, f"node {self._name} has no parameter target: it is no excitation of idloop")
                return
            limits = {name: _number(values.get(f"limit.{name}")) for name in LIMITS}
            adds_to = "command" if values["target"] == "effort" else "reference"
            self._waiting = None
            done(MotionLimits(**limits, adds_to=adds_to, absolute=values["target"] == "reference"))

        self._begin(send, refused)

    def run(self, experiment: str, done: Callable[[str], None], refused: Refused) -> None:
        """Hand an experiment over and start it."""

        def send() -> None:
            value = ParameterValue(type=ParameterType.PARAMETER_STRING, string_value=experiment)
            request = SetParameters.Request(parameters=[Parameter(name="experiment", value=value)])
            self._call(self._set, request, taken)

        def taken(response: Any) -> None:
            result = response.results[0]
            if result.successful:
                self._call(self._run, Trigger.Request(), started)
            else:
                self._end(refused, f"{self._name}: {result.reason}")

        def started(response: Any) -> None:
            if response.success:
                self._waiting = None
                done(response.message)
            else:
                self._end(refused, f"{self._name}: {response.message}")

        self._begin(send, refused)

    def poll(self) -> None:
        """Send what had to wait for the other node, and give up on one that does not answer."""
        if self._waiting is None:
            return
        limit, send, refused = self._waiting
        if time.monotonic() > limit:
            self._end(refused, f"node {self._name} does not answer: is the excitation running in this graph?")
        elif send is not None and all(one.service_is_ready() for one in (self._get, self._set, self._run)):
            self._waiting = limit, None, refused
            send()

    def _begin(self, send: Callable[[], None], refused: Refused) -> None:
        self._waiting = time.monotonic() + PATIENCE, send, refused
        self.poll()

    def _call(self, client: Any, request: Any, answered: Callable[[Any], None]) -> None:
        ours = self._waiting

        def arrived(future: Any) -> None:
            # An answer that comes after we gave up is nobody's any more.
            if self._waiting is not None and ours is not None and self._waiting[0] == ours[0]:
                answered(future.result())

        client.call_async(request).add_done_callback(arrived)

    def _end(self, refused: Refused, reason: str) -> None:
        self._waiting = None
        refused(reason)


def _plain(value: Any) -> float | str | None:
    if value.type == ParameterType.PARAMETER_DOUBLE:
        return float(value.double_value)
    if value.type == ParameterType.PARAMETER_INTEGER:
        return float(value.integer_value)
    if value.type == ParameterType.PARAMETER_STRING:
        return str(value.string_value)
    return None


def _number(value: float | str | None) -> float | None:
    return value if isinstance(value, float) else None
