"""The controller section of a model file, or a file with that section alone."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from idloop.control import check_controller
from idloop.documents import read_text
from idloop.errors import InputError
from idloop.physics.model_file import load_model, preset_names
from idloop.physics.schema import read_mapping


def load_controller(source: str | Path) -> dict[str, Any]:
    """Read the ``controller:`` section of a preset, of a model file, or of a file that holds nothing else.

    `source`: name of a preset, or a YAML file: a model file, ``controller: {type: ...}``, or ``{type: ...}`` by itself.
    Returns: the section as it is written, checked. Raises InputError: one line that names file, key and cure.
    """
    path = Path(source)
    if str(source) in preset_names() or not path.exists():
        section = load_model(source).controller
    else:
        content = read_mapping(read_text(path), str(path))
        if "schema" in content:
            section = load_model(path).controller
        elif set(content) == {"controller"}:
            section = content["controller"]
        elif "type" in content:
            section = content
        else:
            raise InputError(
                f"{path}: neither a model file nor a controller; write for example"
                " `controller: {type: p, output: motor.position, kp: 1.0, sample_time: 0.001}`"
            )
    if section is None:
        raise InputError(f"{source}: no controller; add the section `controller`, or give a file that has it")
    check_controller(section, f"{source}: controller")
    return dict(section)
