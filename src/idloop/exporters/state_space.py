"""python-control: the linear part of a model as a state-space system, and as JSON."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from idloop.errors import InputError
from idloop.exporters.exported import Exported, acts, effects_left_out, file_name, rest_left_out
from idloop.exporters.mechanics import body_names
from idloop.physics.effect import BODY
from idloop.physics.engine import Engine
from idloop.physics.model import Model

if TYPE_CHECKING:
    import control

SCHEMA = "idloop/state-space/1"


def state_space(model: Model) -> control.StateSpace:
    """Linear part of a model as a continuous-time system of python-control.

    Returns: from the command to the outputs; states are positions, then velocities, of all bodies.
    """
    return from_document(to_document(model))


def from_document(document: Mapping[str, Any]) -> control.StateSpace:
    """System of a file that `export` wrote.

    `document`: the parsed JSON. Raises InputError: another kind of document, or matrices of inconsistent shapes.
    """
    import control

    if document.get("schema") != SCHEMA:
        raise InputError(f"state space: schema is {document.get('schema')!r} but must be {SCHEMA!r}: export it again")
    try:
        matrices = [document[key] for key in ("A", "B", "C", "D")]
        names = {key: list(document[key]) for key in ("states", "inputs", "outputs")}
        return control.ss(*matrices, name=document["name"], remove_useless_states=False, **names)
    except KeyError as error:
        raise InputError(f"state space: {error} is missing: export it again") from error
    except (ValueError, TypeError, control.ControlDimension) as error:
        what = f"state space: the shapes of the matrices are inconsistent ({error})"
        raise InputError(f"{what}: export it again") from error


def to_document(model: Model) -> dict[str, Any]:
    """Return matrices, names and units of the linear part, as plain JSON types."""
    from idloop.estimation.black_box.labels import control_names

    engine = Engine(model)
    linear, layout = engine.linearise(), engine.layout()
    bodies = body_names(model, layout)
    position = model.units.position
    return {
        "schema": SCHEMA,
        "name": control_names([model.name])[0],
        "A": (linear.A + 0.0).tolist(),  # no -0.0
        "B": linear.B.reshape(-1, 1).tolist(),
        "C": linear.C.tolist(),
        "D": [[0.0] for _ in model.outputs],
        "states": [f"{body}_{kind}" for kind in ("position", "velocity") for body in bodies],
        "state_units": [unit for unit in (position, f"{position}/s") for _ in bodies],
        "inputs": control_names([model.input.name]),
        "input_units": [model.input.unit],
        "outputs": control_names(model.output_names),
        "output_units": [output.unit for output in model.outputs],
    }


def export(model: Model) -> Exported:
    """Write the linear part as JSON whose A, B, C, D, inputs, outputs and states ``control.ss`` takes."""
    carried = {
        active.name
        for active in model.effects
        if active.effect.splits or (active.effect.linear and active.effect.site == BODY)
    }
    shifted = [
        f"{active.name}.rest: the states are relative to the relaxed springs"
        for active in model.effects
        if active.name in carried and acts(model, active) and model.values.get(f"{active.name}.rest", 0.0) != 0.0
    ]
    left_out = (*effects_left_out(model, carried), *shifted, *rest_left_out(model))
    document = {
        "comment": f"Linear part of the model {model.name}: dx/dt = A x + B u, y = C x + D u, in continuous time.",
        **to_document(model),
        "left_out": left_out,
    }
    lines = [f'  "{key}": {json.dumps(value, ensure_ascii=False, allow_nan=False)}' for key, value in document.items()]
    text = "{\n" + ",\n".join(lines) + "\n}\n"
    return Exported("control", file_name(model.name, ".control.json"), text, left_out)
