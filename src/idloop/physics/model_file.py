"""Model files: presets, reading with all checks, writing."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import replace
from io import StringIO
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from ruamel.yaml import YAML

from idloop.documents import read_text
from idloop.errors import InputError
from idloop.physics.controller_section import check_controller
from idloop.physics.drive_loop import LOOPS, MEMORY, POSITION_LOOP, loop_effect
from idloop.physics.effect import catalogue
from idloop.physics.model import ConditionSource, DriveLoop, InputSignal, Model, OutputSignal
from idloop.physics.parameter import Parameter
from idloop.physics.schema import (
    BODY_PARAMETERS,
    COUPLING_PARAMETERS,
    SCHEMA,
    Drive,
    ModelFile,
    Value,
    read_model_file,
)
from idloop.physics.trust import Allowed, allow, allow_again
from idloop.physics.units import FORCES, Units, input_unit, position_unit
from idloop.spelling import did_you_mean_or_known

PRESETS = Path(__file__).parent / "presets"
# Lower bound of an inertia in a fit, relative to its value in the file.
LEAST_INERTIA = 1e-6


def to_mapping(model: Model) -> dict[str, Any]:
    """Return the model as the mapping of a model file."""
    by_name = {parameter.name: parameter for parameter in model.parameters}

    def number(name: str) -> float | dict[str, float]:
        p = by_name[name]
        if not p.free:
            return p.value
        # Default bounds depend on the value and are not written.
        bounds = zip(("min", "max"), p.stated, strict=True)
        entry = {"value": p.value} | {key: bound for key, bound in bounds if bound is not None}
        if p.stderr is not None:
            entry["stderr"] = p.stderr
        return entry

    file: dict[str, Any] = {"schema": SCHEMA, "name": model.name}
    if model.description:
        file["description"] = model.description
    file["input"] = {key: getattr(model.input, key) for key in ("topic", "joint", "field", "unit")}
    if model.input.kind != "held":
        file["input"]["kind"] = model.input.kind
    file["outputs"] = []
    for output in model.outputs:
        usual = {"body": output.joint, "scale": 1.0, "noise": None}
        file["outputs"].append({key: value for key, value in vars(output).items() if usual.get(key, ...) != value})
    file["bodies"] = [
        {"name": body, **{own: number(f"{body}.{own}") for own in BODY_PARAMETERS}} for body in model.bodies
    ]
    file["couplings"] = [
        {"from": a, "to": b, **{own: number(f"{coupling}.{own}") for own in COUPLING_PARAMETERS}}
        for coupling, a, b in zip(model.couplings, model.bodies[:-1], model.bodies[1:], strict=True)
    ]
    file["drive"] = {"gain": number("drive.gain")}
    if model.loop is not None:
        file["drive"] = {"kind": model.loop.effect.name, "unit": model.units.input, **file["drive"]}
        named = [spec.name for spec in model.loop.effect.parameters if f"drive.{spec.name}" in by_name]
        file["drive"] |= {name: number(f"drive.{name}") for name in named}
    if model.conditions:
        blank = ConditionSource("", "", "", "", "")
        file["conditions"] = [
            {key: value for key, value in vars(one).items() if value != getattr(blank, key)} | {"unit": one.unit}
            for one in model.conditions
        ]
    file["effects"] = []
    before = replace(model, effects=())
    for active in model.effects:
        line: dict[str, Any] = {"effect": active.effect.name, "at": active.at}
        if active.number != before.next_number(active.effect, active.at):
            line["number"] = active.number
        before = replace(before, effects=(*before.effects, active))
        for spec in active.effect.parameters:
            if f"{active.name}.{spec.name}" in by_name:
                line[spec.name] = number(f"{active.name}.{spec.name}")
        file["effects"].append(line)
    if model.disturbance is not None:
        file["disturbance"] = {"intensity": model.disturbance}
    file["controller"] = model.controller
    return file


def with_joints(model: Model, names: Mapping[str, str]) -> Model:
    """Return the model with its signals at joints of other names; its bodies keep theirs.

    `names`: new name by joint of the model.
    Raises InputError: a joint that the model does not have.
    """
    known = {model.input.joint, *(output.joint for output in model.outputs)}
    for name in names:
        if name not in known:
            raise InputError(f"no joint '{name}' in the model{did_you_mean_or_known(name, known)}")
    file = to_mapping(model)
    for signal in (file["input"], *file["outputs"]):
        joint = signal["joint"]
        if signal is not file["input"]:
            signal.setdefault("body", joint)
        signal["joint"] = names.get(joint, joint)
    for effect in file["effects"]:
        effect["at"] = re.sub(r"\[(.+)\]$", lambda match: f"[{names.get(match[1], match[1])}]", effect["at"])
    controller = file["controller"]
    if controller is not None and "output" in controller:
        joint, _, field = str(controller["output"]).rpartition(".")
        file["controller"] = {**controller, "output": f"{names.get(joint, joint)}.{field}"}
    return build_model(ModelFile.model_validate(file), model.name, model.folder)


def to_yaml(model: Model) -> str:
    """Return a model as the text of a model file."""
    yaml = YAML()
    yaml.default_flow_style = None
    yaml.width = 120
    yaml.representer.add_representer(type(None), lambda r, _: r.represent_scalar("tag:yaml.org,2002:null", "null"))
    stream = StringIO()
    yaml.dump(to_mapping(model), stream)
    return stream.getvalue()


def from_text(text: str, folder: Path | None, allowed: Iterable[Allowed] = ()) -> Model:
    """Make a model of the text that `to_yaml` wrote.

    `folder`: folder that contains the folder ``effects``.
    `allowed`: effect files that another process has allowed, see `idloop.physics.trust`.
    """
    allow_again(allowed)
    return build_model(read_model_file(text, "model"), "model", folder)


def _base_parameter(name: str, value: Value, unit: str, low: float, where: str, *, positive: bool = False) -> Parameter:
    if value.value < low or (positive and value.value <= low) or not np.isfinite(value.value):
        bound = "finite" if np.isinf(value.value) else "> 0" if positive else f">= {low:g}"
        raise InputError(f"{where}: {name}: must be {bound} {unit} (got {value.value:g})")
    if positive:
        low = LEAST_INERTIA * value.value
    low = low if value.min is None else max(low, value.min)
    high = np.inf if value.max is None else value.max
    return Parameter(name, value.value, low, high, value.free, value.stderr, unit, (value.min, value.max))


def build_model(file: ModelFile, where: str, folder: Path | None = None) -> Model:
    """Make a model of a checked file. Raises InputError: inconsistent units, bodies, couplings or effects."""
    bodies = tuple(body.name for body in file.bodies)
    for name in bodies:
        if bodies.count(name) > 1 or not re.fullmatch(r"\w+", name) or name in ("input", "drive"):
            raise InputError(f"{where}: bodies: '{name}' is not a usable name: letters, digits and _, each name once")
    unit = input_unit(file.input.unit, f"{where}: input.unit")
    command = InputSignal(**{**file.input.model_dump(), "unit": unit})
    outputs = []
    for index, output in enumerate(file.outputs):
        at = f"{where}: outputs[{index}]"
        position_unit(output.unit, output.field, f"{at}.unit")
        body = output.body or output.joint
        if body not in bodies:
            raise InputError(f"{at}: there is no body '{body}'{did_you_mean_or_known(body, bodies)}")
        outputs.append(OutputSignal(**{**output.model_dump(), "body": body}))
    for key, several in (("outputs", outputs), ("conditions", file.conditions)):
        twice = next((name for name, count in Counter(one.name for one in several).items() if count > 1), None)
        if twice is not None:
            raise InputError(f"{where}: {key}: '{twice}' is there twice: remove one")
    # a scaled output shows the motion in another unit than that of the bodies
    plain = [output for output in outputs if output.scale == 1.0] or outputs
    kinds = sorted({position_unit(output.unit, output.field, where) for output in plain})
    if len(kinds) > 1:
        raise InputError(f"{where}: outputs: the units {' and '.join(kinds)} do not fit one axis: use one, or scale")
    force = FORCES[kinds[0]]
    loop = _loop(file.drive, command, kinds[0], where)
    units = Units(input_unit(file.drive.unit, f"{where}: drive.unit") if loop else command.unit, kinds[0], force)

    parameters = []

    def add(name: str, value: Value, unit: str, low: float = 0.0, *, positive: bool = False) -> None:
        parameters.append(_base_parameter(name, value, units.fill(unit), low, where, positive=positive))

    for part in file.bodies:
        add(f"{part.name}.inertia", part.inertia, units.inertia, positive=True)
        add(f"{part.name}.viscous_friction", part.viscous_friction, "{force}·s/{position}")
    chain = list(pairwise(bodies))
    given = {(c.source, c.target): c for c in file.couplings}
    for pair in given:
        if pair not in chain:
            raise InputError(
                f"{where}: couplings: {pair[0]}-{pair[1]} does not join neighbours of the chain {' - '.join(bodies)}"
            )
    for pair in chain:
        if pair not in given:
            raise InputError(f"{where}: couplings: nothing joins {pair[0]} and {pair[1]}: add from, to and stiffness")
        coupling = given[pair]
        name = f"{pair[0]}-{pair[1]}"
        add(f"{name}.stiffness", coupling.stiffness, "{force}/{position}")
        add(f"{name}.damping", coupling.damping, "{force}·s/{position}")
    add("drive.gain", file.drive.gain, "-" if force == units.input else "{force}/{input}", -np.inf)
    for name, value in file.drive.loop_parameters.items():
        spec = LOOPS[file.drive.kind].spec(name)
        add(f"drive.{name}", value, spec.unit, spec.min)

    if file.controller is not None:
        check_controller(file.controller, f"{where}: controller")

    model = Model(
        name=file.name,
        description=file.description or "",
        input=command,
        outputs=tuple(outputs),
        bodies=bodies,
        parameters=tuple(parameters),
        effects=(),
        units=units,
        controller=file.controller,
        disturbance=file.disturbance.intensity if file.disturbance else None,
        conditions=tuple(ConditionSource(**one.model_dump()) for one in file.conditions),
        folder=folder,
        loop=loop,
    )
    at = where
    try:
        for index, entry in enumerate(file.effects):
            at = f"{where}: effects[{index}]"
            model = model.with_entry(entry.effect, entry.at, entry.model_extra or {}, entry.number)
        at = where
        return model.checked()
    except InputError as error:
        raise InputError(f"{at}: {error}") from error


def _loop(drive: Drive, command: InputSignal, position: str, where: str) -> DriveLoop | None:
    """The loop of a drive, with its set-point in the unit of what it controls."""
    if drive.kind not in LOOPS:
        return None
    wanted = position if drive.kind == POSITION_LOOP.name else f"{position}/s"
    if command.unit != wanted:
        raise InputError(
            f"{where}: input.unit: the set-point of a {drive.kind.replace('_', ' ')} is in {wanted}"
            f" (got {command.unit})"
        )
    memory = any(name in drive.loop_parameters for name in MEMORY)
    return DriveLoop(loop_effect(drive.kind, memory=memory))


def preset_names() -> tuple[str, ...]:
    """Names of the preset models."""
    return tuple(sorted(path.stem for path in PRESETS.glob("*.yaml")))


def load_model(source: str | Path, *, allow_effects: bool = False) -> Model:
    """Read a model: the name of a preset, or a model file.

    Parameters
    ----------
    source : str or Path
    allow_effects : bool
        Run the Python files in the folder ``effects`` beside the model file without `idloop trust`, in this process and
        for the present content of the files.

    Raises
    ------
    InputError
        One line with file, key and correction; also for effect files that are not trusted.
    """
    path = Path(source)
    if str(source) in preset_names():
        path = PRESETS / f"{source}.yaml"
        return build_model(read_model_file(read_text(path), f"preset {source}"), f"preset {source}")
    if not path.exists():
        raise InputError(
            f"model '{source}': no such file, and no preset of this name: presets are {', '.join(preset_names())}"
        )
    if path.is_dir():
        inside = path / "model.yaml"
        bag = "; a recording comes after MODEL" if (path / "metadata.yaml").is_file() else ""
        raise InputError(f"model '{source}': is a folder" + (f"; its model is {inside}" if inside.is_file() else bag))
    folder = path.resolve().parent
    file = read_model_file(read_text(path), str(path))
    if allow_effects:
        allow(folder / "effects")
    # Checked whether the model uses one of them or not.
    catalogue(folder / "effects")
    return build_model(file, str(path), folder)
