"""Ranges for domain randomisation: intervals of the parameters, and settings of simulators that draw from them."""

from __future__ import annotations

from typing import Any

import yaml

from idloop.exporters.exported import Exported, commented, effects_left_out, file_name, parameters_of
from idloop.exporters.mechanics import digits, mechanics, scale_notes
from idloop.physics.effect import parameter_as
from idloop.physics.model import Model
from idloop.physics.parameter import Parameter

SCHEMA = "idloop/ranges/1"
LEVEL = 0.95


def export(model: Model) -> Exported:
    """Write the 95 % interval of every estimated parameter as a range, cut off at the parameter's bounds.

    An axis of one body has the ranges of its joint in MuJoCo and Isaac Lab, too. Parameters without a standard error
    have no range.

    Raises InputError: the positions are not those of a joint.
    """
    found = mechanics(model, "ranges")
    ranges = {p.name: _range(p) for p in model.parameters if p.interval is not None}
    document: dict[str, Any] = {
        "schema": SCHEMA,
        "model": model.name,
        "joint": model.input.joint,
        "level": LEVEL,
        "parameters": ranges,
        "without_range": [p.name for p in model.parameters if p.name not in ranges],
    }
    if len(found.bodies) == 1:
        document |= _of_simulators(_of_joint(model))
    notes = [
        "A range is the 95 % interval of one parameter by itself: estimates that are correlated vary together.",
        "scale: the range over the value, for operations that multiply.",
        "mujoco: fields of mjModel at the joint. isaac_lab: events and their arguments.",
        "The armature is changed by a sum, since it has a part of the inertia only: the links have theirs.",
        "Isaac Lab draws static, dynamic and viscous friction from one range: it holds the wider one, as a scale.",
        "An interval holds what noise leaves open, not what differs between machines: widen it for those.",
        *scale_notes(model),
    ]
    if not ranges:
        notes.append("No parameter has a standard error: export a model that fit or refine has written.")
    carried = {a.name for a in model.effects if any(f"{a.name}.{own}" in ranges for own in parameters_of(model, a))}
    left_out = effects_left_out(model, carried)
    text = commented(model, "Ranges for domain randomisation", notes, left_out)
    text += yaml.safe_dump(document, sort_keys=False, allow_unicode=True, default_flow_style=None, width=120)
    return Exported("ranges", file_name(model.name, ".ranges.yaml"), text, left_out)


def _range(parameter: Parameter) -> dict[str, Any]:
    low, high = _ends(parameter)
    entry: dict[str, Any] = {"value": _short(parameter.value), "low": low, "high": high, "unit": parameter.unit}
    if parameter.value > 0.0 and low >= 0.0:
        entry["scale"] = [_short(low / parameter.value), _short(high / parameter.value)]
    return entry


def _ends(parameter: Parameter) -> tuple[float, float]:
    low, high = parameter.interval or (parameter.value, parameter.value)
    return _short(max(low, parameter.min)), _short(min(high, parameter.max))


def _short(value: float) -> float:
    return float(digits(float(f"{value:.6g}")))


def _of_joint(model: Model) -> dict[str, Parameter]:
    """Estimated parameters that are fields of a joint of MuJoCo, by the field."""
    (body,) = model.bodies
    names = {"dof_armature": f"{body}.inertia", "dof_damping": f"{body}.viscous_friction"}
    dry = [
        f"{active.name}.{level}"
        for active in model.effects
        if (level := parameter_as(active.effect, lambda effect: effect.dry_level, *model.effect_folders))
    ]
    if len(dry) == 1:
        names["dof_frictionloss"] = dry[0]
    fields = {field: model.parameter(name) for field, name in names.items()}
    return {field: one for field, one in fields.items() if one.interval is not None}


def _of_simulators(fields: dict[str, Parameter]) -> dict[str, Any]:
    mujoco: dict[str, Any] = {}
    events: list[dict[str, Any]] = []
    event = {"event": "randomize_joint_parameters", "distribution": "uniform"}
    for field, one in fields.items():
        low, high = _ends(one)
        if field == "dof_armature":
            more = [_short(end - _short(one.value)) for end in (low, high)]
            mujoco[field] = {"operation": "add", "range": more}
            events.append(event | {"operation": "add", "armature_distribution_params": [*more]})
        else:
            mujoco[field] = {"operation": "abs", "range": [low, high]}
    friction = [_range(one).get("scale") for field, one in fields.items() if field != "dof_armature"]
    if any(friction):
        lows, highs = zip(*filter(None, friction), strict=True)
        events.append(event | {"operation": "scale", "friction_distribution_params": [min(lows), max(highs)]})
    return {"mujoco": mujoco, "isaac_lab": events}
