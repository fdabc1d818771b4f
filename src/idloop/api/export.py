"""A model in the formats of a robot's stack, and as a python-control system."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from idloop.api.fit import Fit
from idloop.api.identification import Identification
from idloop.api.ladder import Ladder
from idloop.errors import InputError
from idloop.exporters import Exported
from idloop.exporters import export as export_model

if TYPE_CHECKING:
    import control
    from idloop.physics import Model


def export(model: Model, form: str, path: str | Path | None = None) -> Exported:
    """Write a model in another tool's format.

    Parameters
    ----------
    model : Model
        Usually as a fit has left it.
    form : {"urdf", "mujoco", "usd", "control", "ros2_control", "compensator", "c", "ranges", "json"}
    path : str or Path, optional
        Also write the file.

    Returns
    -------
    Exported
        The text of the file, and what of the model it cannot carry.

    Raises
    ------
    InputError
        Unknown format, or a model that the format cannot hold.

    Examples
    --------
    >>> import idloop
    >>> idloop.export(idloop.load_model("axis"), "mujoco").text.startswith("<")
    True
    """
    written = export_model(model, form)
    if path is not None:
        from idloop.output_files import write_text

        write_text(Path(path), written.text)
    return written


def to_control(model: Model | Fit | Ladder | Identification) -> control.StateSpace:
    """Linear part of a model as a python-control system, from the command to the outputs.

    Parameters
    ----------
    model : Model, Fit, Ladder or Identification
        Of an identification the model of the first method.

    Returns
    -------
    control.StateSpace
        Continuous of a grey-box model, sampled of a black-box one; names are those of the signals with "." as "_".

    Raises
    ------
    InputError
        The method of an identification gave no linear model.

    Examples
    --------
    >>> import idloop
    >>> idloop.to_control(idloop.load_model("dc_motor")).nstates
    2
    """
    from idloop.exporters.state_space import state_space

    if isinstance(model, Identification):
        linear = model.linear
        if linear is None:
            raise InputError(f"{model.outcomes[0].label} gives no linear model: identify --list shows which methods do")
        return linear.system
    return state_space(model.model if isinstance(model, Fit | Ladder) else model)
