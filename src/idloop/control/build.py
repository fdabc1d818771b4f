"""Controllers from the `controller:` section of a model file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from idloop.physics.controller_section import check_controller

if TYPE_CHECKING:
    from idloop.control.compensation import Compensation
    from idloop.control.controller import Controller


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
