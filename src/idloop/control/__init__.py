"""Controllers and compensators.

``build_controller({"type": "pid", "output": "motor.position", "kp": 8.4, "ki": 0.3, "kd": 0.8,
"limit": 2.95, "sample_time": 0.001})`` gives a `Controller`; ``CONTROLLERS`` lists the types with
their parameters. ``idloop.control.step.controller_step`` is the compiled step.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from idloop.physics.controller_section import CONTROLLERS, ControllerKind, check_controller

if TYPE_CHECKING:
    from idloop.control.compensation import Compensation
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


def build_controller(
    spec: Mapping[str, Any] | None, where: str = "controller", compensation: Compensation | None = None
) -> Controller:
    """Build a controller.

    `spec`: ``controller:`` section of a model file: ``type`` and the parameters of that type
    (``CONTROLLERS[type].parameters``), nested or dotted. None stands for ``{type: none}``. `where`: place named at the
    start of an error line. `compensation`: effects of a fitted model to cancel. Raises InputError: the section does not
    describe a controller, or an effect cannot be cancelled.
    """
    values = check_controller(spec, where)
    # The compiled step needs numba, which takes a second to import.
    from idloop.control.controller import Controller
    from idloop.control.packing import pack

    kernel = pack(values, where)
    if compensation is None:
        return Controller(values, kernel)
    from idloop.control.compensation import plan_compensation
    from idloop.control.compensation_packing import add_compensation
    from idloop.control.compensation_settings import choose_settings

    plan = plan_compensation(compensation, values)
    settings = choose_settings(compensation, plan, values)
    return Controller(values, add_compensation(kernel, compensation.model, plan, settings, values), plan, settings)


def __getattr__(name: str) -> Any:
    # These two import numba: only when somebody asks for them.
    if name == "Controller":
        from idloop.control.controller import Controller

        return Controller
    if name == "Kernel":
        from idloop.control.packing import Kernel

        return Kernel
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
