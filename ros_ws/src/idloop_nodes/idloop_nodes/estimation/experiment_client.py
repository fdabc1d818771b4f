"""How the estimator hands an experiment over to the excitation node: parameters and one service."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from idloop_nodes.estimation.diagnosis_jobs import MotionLimits
from idloop_nodes.service_calls import ServiceCalls

TIMEOUT = 10.0  # seconds within which the excitation node has to answer
LIMITS = ("amplitude", "position_min", "position_max", "velocity")

Refused = Callable[[str], None]


class ExperimentClient:
    """Calls the excitation node without waiting for it.

    `excitation`: name of the excitation node.
    """

    def __init__(self, node: Any, excitation: str) -> None:
        self._name = excitation
        self._calls = ServiceCalls(node)
        self._calls.expect(f"{excitation}/run_experiment")

    @property
    def busy(self) -> bool:
        """Whether an answer is still to come."""
        return self._calls.busy

    def ask_limits(self, done: Callable[[MotionLimits], None], refused: Refused) -> None:
        """Ask what an experiment may do."""

        def answered(values: list[Any]) -> None:
            target, *limits = values
            if target is None:
                refused(f"node {self._name} has no parameter target: it is no excitation of idloop")
                return
            known = {name: one if isinstance(one, float) else None for name, one in zip(LIMITS, limits, strict=True)}
            adds_to = "command" if target == "effort" else "reference"
            done(MotionLimits(**known, adds_to=adds_to, absolute=target == "reference"))

        names = ["target", *(f"limit.{name}" for name in LIMITS)]
        self._calls.get_parameters(self._name, names, answered, lambda _, reason: refused(reason), TIMEOUT)

    def run(self, experiment: str, done: Callable[[str], None], refused: Refused) -> None:
        """Hand an experiment over and start it."""

        def taken(accepted: bool, reason: str) -> None:
            if accepted:
                self._calls.trigger(f"{self._name}/run_experiment", started, TIMEOUT)
            else:
                refused(f"{self._name}: {reason}")

        def started(success: bool, message: str) -> None:
            if success:
                done(message)
            else:
                refused(f"{self._name}: {message}")

        self._calls.set_parameter(self._name, "experiment", experiment, "", taken, TIMEOUT)

    def poll(self) -> None:
        """Send what had to wait for the other node, and give up on one that does not answer."""
        self._calls.poll()
