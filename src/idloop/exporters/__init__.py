"""Export of a model to the formats of other tools: one module per format."""

from __future__ import annotations

import importlib

from idloop.errors import InputError
from idloop.exporters.exported import Exported
from idloop.physics.model import Model
from idloop.spelling import did_you_mean_or_known

# Format: the module with its function `export`.
FORMATS = {
    "urdf": "idloop.exporters.urdf",
    "mujoco": "idloop.exporters.mujoco",
    "usd": "idloop.exporters.usd",
    "control": "idloop.exporters.state_space",
    "ros2_control": "idloop.exporters.ros2_control",
    "compensator": "idloop.exporters.compensator",
    "c": "idloop.exporters.c_header",
    "ranges": "idloop.exporters.ranges",
    "json": "idloop.exporters.plain_json",
}

__all__ = ["FORMATS", "Exported", "export"]


def export(model: Model, form: str) -> Exported:
    """Write a model in another tool's format.

    `model`: the axis, usually as a fit has left it. `form`: one of `FORMATS`. Returns text of the file, and the parts
    of the model that it cannot represent. Raises InputError: unknown format, or a model that it cannot represent.
    """
    if form not in FORMATS:
        raise InputError(f"unknown format '{form}'{did_you_mean_or_known(form, list(FORMATS))}")
    written: Exported = importlib.import_module(FORMATS[form]).export(model)
    return written
