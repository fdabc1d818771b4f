"""Controllers and compensators.

``build_controller({"type": "pid", "output": "motor.position", "kp": 8.4, "ki": 0.3, "kd": 0.8,
"limit": 2.95, "sample_time": 0.001})`` gives a `Controller`; ``CONTROLLERS`` lists the types with
their parameters. ``idloop.control.step.controller_step`` is the compiled step.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from idloop.control.build import build_controller
from idloop.physics.controller_section import CONTROLLERS, ControllerKind, check_controller

if TYPE_CHECKING:
    from idloop.control.controller import Controller
    from idloop.control.packing import Kernel

__all__ = [
    "CONTROLLERS",
    "Controller",
    "ControllerKind",
    "Kernel",
    "build_controller",
    "check_controller",
]


def __getattr__(name: str) -> Any:
    # These two import numba: only when somebody asks for them.
    if name == "Controller":
        from idloop.control.controller import Controller

        return Controller
    if name == "Kernel":
        from idloop.control.packing import Kernel

        return Kernel
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
