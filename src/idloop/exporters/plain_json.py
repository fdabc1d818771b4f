"""Plain JSON: every number of the model with its unit, its standard error and its bounds."""

from __future__ import annotations

import json
import math
from typing import Any

from idloop.exporters.exported import Exported, file_name, parameters_of
from idloop.physics.model import Model
from idloop.physics.parameter import Parameter

SCHEMA = "idloop/parameters/1"
_OF_OUTPUT = ("joint", "field", "unit", "body", "scale", "noise")


def export(model: Model) -> Exported:
    """Write every number of a model; infinite values and bounds become null."""
    own = {f"{active.name}.{name}" for active in model.effects for name in parameters_of(model, active)}
    intensity = model.disturbance
    disturbance = None if intensity is None else {"intensity": intensity, "unit": f"{model.units.force}²/s"}
    document = {
        "schema": SCHEMA,
        "name": model.name,
        "description": " ".join(model.description.split()),
        "input": {"joint": model.input.joint, "field": model.input.field, "unit": model.input.unit},
        "outputs": [{key: getattr(output, key) for key in _OF_OUTPUT} for output in model.outputs],
        "drive": {"kind": model.loop.effect.name if model.loop else "force", "unit": model.units.input},
        "bodies": list(model.bodies),
        "couplings": list(model.couplings),
        "parameters": {p.name: _number(p) for p in model.parameters if p.name not in own},
        "effects": [
            {
                "effect": active.effect.name,
                "at": active.at,
                "text": active.effect.text,
                "parameters": {name: _number(p) for name, p in parameters_of(model, active).items()},
            }
            for active in model.effects
        ],
        "disturbance": disturbance,
        "controller": model.controller,
        "left_out": [],
    }
    text = json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    return Exported("json", file_name(model.name, ".json"), text, ())


def _number(parameter: Parameter) -> dict[str, Any]:
    bounds = {"min": _finite(parameter.min), "max": _finite(parameter.max)} if parameter.free else {}
    return {
        "value": _finite(parameter.value),
        "unit": parameter.unit,
        "stderr": _finite(parameter.stderr),
        "estimated": parameter.free,
        **bounds,
    }


def _finite(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None
