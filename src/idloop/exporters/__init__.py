"""What was identified, in the formats of a robot's stack: one file per format."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

from idloop.errors import InputError
from idloop.exporters.exported import Exported
from idloop.spelling import did_you_mean_or_known

if TYPE_CHECKING:
    from idloop.physics.model import Model

# Format: the module with its function `export`.
FORMATS = {
    "urdf": "idloop.exporters.urdf",
    "mujoco": "idloop.exporters.mujoco",
    "control": "idloop.exporters.state_space",
    "ros2_control": "idloop.exporters.ros2_control",
    "compensator": "idloop.exporters.compensator",
    "json": "idloop.exporters.plain_json",
}

__all__ = ["FORMATS", "Exported", "export"]


def export(model: Model, form: str) -> Exported:
    """Write a model in another tool's format.

    Parameters
    ----------
    model : Model
        The axis, usually as a fit has left it.
    form : str
        One of `FORMATS`.

    Returns
    -------
    Exported
        The text of the file, and what of the model it cannot carry.

    Raises
    ------
    InputError
        Unknown format, or a model that it has no words for.
    """
    if form not in FORMATS:
        raise InputError(f"unknown format '{form}'{did_you_mean_or_known(form, list(FORMATS))}")
    written: Exported = importlib.import_module(FORMATS[form]).export(model)
    return written
