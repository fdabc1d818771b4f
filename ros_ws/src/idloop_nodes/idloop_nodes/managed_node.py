"""A node with a lifecycle and an emergency stop: only the active state may move a motor."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from std_srvs.srv import Trigger

from idloop_nodes.base import StreamNode

STOPPED = "stopped until ~/reset"


@dataclass(eq=False)
class EmergencyStop:
    """``~/emergency_stop``, latched, and ``~/reset``."""

    node: Any  # node that offers them
    lock: threading.Lock  # held while one of them is served
    stop: Callable[[], None]  # stops the motor at once
    reset: Callable[[], str]  # clears stop and faults; returns why that cannot be done, empty when it was
    done: str  # message of a successful reset
    latched: str = ""  # ``emergency stop`` until reset

    def __post_init__(self) -> None:
        """Offer the services."""
        self.node.create_service(Trigger, "~/emergency_stop", self._on_emergency_stop)
        self.node.create_service(Trigger, "~/reset", self._on_reset)

    def _on_emergency_stop(self, request: Any, response: Any) -> Any:
        with self.lock:
            self.latched = "emergency stop"
            self.stop()
        self.node.get_logger().warning(f"emergency stop: {STOPPED}")
        response.success, response.message = True, STOPPED
        return response

    def _on_reset(self, request: Any, response: Any) -> Any:
        with self.lock:
            refused = self.reset()
            if not refused:
                self.latched = ""
        response.success, response.message = not refused, refused or self.done
        return response


class ManagedNode(StreamNode, LifecycleNode):
    """A stream node with a lifecycle."""

    def __init__(self, kind: str, **options: Any) -> None:
        self.active = False
        self._configured = False
        super().__init__(kind, **options)

    def destroy_node(self) -> None:
        """Destroy the services of the lifecycle as well: left to the collector, they keep their participant alive."""
        super().destroy_node()
        self._state_machine.destroy_when_not_in_use()

    def start_by_itself(self) -> None:
        """Configure and activate when the parameter autostart is set."""
        if self.parameters["autostart"]:
            self.bring_up()

    def bring_up(self) -> None:
        """Go to the active state from any state."""
        if not self._configured:
            self.trigger_configure()
        if not self.active:
            self.trigger_activate()

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Remember that only activation is left."""
        self._configured = True
        return super().on_configure(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Back to unconfigured."""
        self._configured = False
        return super().on_cleanup(state)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Become active."""
        self.active = True
        self.activated()
        return super().on_activate(state)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Become inactive: from now on only neutral values leave this node."""
        self._leave_active()
        return super().on_deactivate(state)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """End as deactivation does: this transition may come straight from the active state."""
        if self.active:
            self._leave_active()
        return super().on_shutdown(state)

    def _leave_active(self) -> None:
        self.active = False
        self.deactivated()

    def activated(self) -> None:
        """Do what activation needs."""

    def deactivated(self) -> None:
        """Do what deactivation needs."""
