"""From the `controller:` section of a model file to a controller."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from idloop.control.check import check_controller

if TYPE_CHECKING:
    from idloop.control.controller import Controller


def build_controller(spec: Mapping[str, Any] | None, where: str = "controller") -> Controller:
    """Build a controller.

    Parameters
    ----------
    spec : mapping or None
        ``controller:`` section of a model file: ``type`` and the parameters of that type
        (``CONTROLLERS[type].parameters``), nested or dotted. None stands for ``{type: none}``.
    where : str
        Place named at the start of an error line.

    Returns
    -------
    Controller

    Raises
    ------
    InputError
        The section does not describe a controller.
    """
    values = check_controller(spec, where)
    # The compiled step needs numba, which takes a second to import: not before it is used.
    from idloop.control.controller import Controller
    from idloop.control.packing import pack

    return Controller(values, pack(values, where))
