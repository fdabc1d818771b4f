"""The model file ``idloop/model/1`` as YAML, checked key by key."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, field_validator, model_validator

from idloop.documents import MOST_NAME, read_yaml
from idloop.errors import InputError
from idloop.physics.drive_loop import LOOPS
from idloop.spelling import did_you_mean_or_known

SCHEMA = "idloop/model/1"
STRICT = ConfigDict(extra="forbid", frozen=True)
Name = Annotated[str, Field(max_length=MOST_NAME)]
# Most outputs, bodies, couplings, effects: matrices grow with the square.
_MOST_PARTS = 100


class Value(BaseModel):
    """A number: known when bare, estimated when a mapping."""

    model_config = STRICT
    value: float
    min: float | None = None
    max: float | None = None
    stderr: float | None = None
    free: bool = Field(default=True, exclude=True)

    @model_validator(mode="after")
    def _within(self) -> Value:
        if math.isnan(self.value):
            raise ValueError("value is not a number")
        if self.min is not None and self.value < self.min:
            raise ValueError(f"value {self.value:g} is below min {self.min:g}")
        if self.max is not None and self.value > self.max:
            raise ValueError(f"value {self.value:g} is above max {self.max:g}")
        return self


def read_value(raw: Any) -> Any:
    """Take a bare number as known."""
    if isinstance(raw, bool):
        raise ValueError("a number or a mapping with 'value' is needed")  # noqa: TRY004 (pydantic makes a line of it)
    if isinstance(raw, int | float):
        return Value(value=float(raw), free=False)
    if isinstance(raw, Mapping):
        known = ["value", "min", "max", "stderr"]
        for key in raw:
            if key not in known:
                raise ValueError(f"unknown key '{key}'{did_you_mean_or_known(str(key), known)}")
        if "value" not in raw:
            raise ValueError("the mapping needs the key 'value'")
        return Value(**raw)
    if isinstance(raw, Value):
        return raw
    raise ValueError("a number or a mapping with 'value' is needed")


Number = Annotated[Value, BeforeValidator(read_value)]


class Input(BaseModel):
    """Source of the command, and whether it is held until the next one or a measured signal."""

    model_config = STRICT
    topic: Name = "joint_command"
    joint: Name
    field: Literal["position", "velocity", "effort"] = "effort"
    unit: str
    kind: Literal["held", "measured"] = "held"


class Output(BaseModel):
    """A measured signal: which body, in which unit, with which noise."""

    model_config = STRICT
    topic: Name = "joint_states"
    joint: Name
    field: Literal["position", "velocity"]
    unit: str
    body: Name | None = None
    scale: float = 1.0
    noise: float | None = Field(default=None, ge=0.0)


class MeasuredCondition(BaseModel):
    """A condition measured beside the axis: its name, topic, and field of the message."""

    model_config = STRICT
    name: Name
    topic: Name
    joint: Name = ""
    field: Name = ""
    unit: Name
    scale: float = Field(default=1.0, allow_inf_nan=False)
    offset: float = Field(default=0.0, allow_inf_nan=False)


class Body(BaseModel):
    """An inertia of the chain."""

    model_config = STRICT
    name: Name
    inertia: Number
    viscous_friction: Number = Value(value=0.0, free=False)


# Parameters of a body, and of a coupling, without those of effects.
BODY_PARAMETERS = tuple(name for name in Body.model_fields if name != "name")


class Coupling(BaseModel):
    """A spring and damper between two neighbours of the chain."""

    model_config = ConfigDict(extra="forbid", frozen=True, populate_by_name=True)
    source: Name = Field(alias="from")
    target: Name = Field(alias="to")
    stiffness: Number
    damping: Number = Value(value=0.0, free=False)


COUPLING_PARAMETERS = tuple(name for name in Coupling.model_fields if name not in ("source", "target"))


class Drive(BaseModel):
    """Force per unit of command, or of the output of a loop inside the drive."""

    model_config = STRICT
    kind: Literal["force", "velocity_loop", "position_loop"] = "force"
    unit: str = "-"
    gain: Number = Value(value=1.0, free=False)
    proportional: Number | None = None
    integral: Number | None = None
    derivative: Number | None = None
    feed_forward: Number | None = None
    limit: Number | None = None
    sample_time: Number | None = None
    delay: Number | None = None
    profile_velocity: Number | None = None
    profile_acceleration: Number | None = None
    dead_band: Number | None = None

    @property
    def loop_parameters(self) -> dict[str, Value]:
        """What is said of the loop, by name."""
        own = {name: getattr(self, name) for name in type(self).model_fields if name not in ("kind", "unit", "gain")}
        return {name: value for name, value in own.items() if value is not None}

    @model_validator(mode="after")
    def _of_its_kind(self) -> Drive:
        given = self.loop_parameters
        if self.kind == "force":
            if given or "unit" in self.model_fields_set:
                word = next(iter(given), "unit")
                raise ValueError(f"'{word}' belongs to a loop: add 'kind: position_loop' or 'kind: velocity_loop'")
            return self
        known = [spec.name for spec in LOOPS[self.kind].parameters]
        for name in given:
            if name not in known:
                raise ValueError(f"a {self.kind} has no '{name}'{did_you_mean_or_known(name, known)}")
        if "proportional" not in given:
            raise ValueError(f"a {self.kind} needs 'proportional', its gain")
        return self


class EffectEntry(BaseModel):
    """An effect at a site; its parameters are the further keys."""

    model_config = ConfigDict(extra="allow", frozen=True)
    effect: Name
    at: Name
    number: int | None = Field(default=None, ge=1)


class Disturbance(BaseModel):
    """Disturbance force on body 0, as estimated by a fit: a random walk."""

    model_config = STRICT
    intensity: float = Field(ge=0.0)


class ModelFile(BaseModel):
    """The whole file."""

    model_config = ConfigDict(extra="forbid", frozen=True, populate_by_name=True)
    schema_name: Literal["idloop/model/1"] = Field(default="idloop/model/1", alias="schema")
    name: Name
    description: str | None = None
    input: Input
    outputs: list[Output] = Field(min_length=1, max_length=_MOST_PARTS)
    bodies: list[Body] = Field(min_length=1, max_length=_MOST_PARTS)
    couplings: list[Coupling] = Field(default=[], max_length=_MOST_PARTS)
    drive: Drive = Drive()
    conditions: list[MeasuredCondition] = Field(default=[], max_length=_MOST_PARTS)
    effects: list[EffectEntry] = Field(default=[], max_length=_MOST_PARTS)
    disturbance: Disturbance | None = None
    controller: dict[str, Any] | None = None

    @field_validator("couplings", "conditions", "effects", mode="before")
    @classmethod
    def _empty(cls, raw: Any) -> Any:
        """A key without a value is an empty list."""
        return [] if raw is None else raw


def reason(error: ValueError) -> str:
    """Message of a failed validation."""
    message = error.errors()[0]["msg"] if isinstance(error, ValidationError) else str(error)
    return message.removeprefix("Value error, ")


def _known_keys(location: tuple[int | str, ...]) -> list[str]:
    """Known keys at the place of an unknown one."""
    classes: dict[str, type[BaseModel]] = {
        "input": Input,
        "outputs": Output,
        "bodies": Body,
        "couplings": Coupling,
        "drive": Drive,
        "conditions": MeasuredCondition,
        "disturbance": Disturbance,
    }
    kind = classes.get(str(location[0]), ModelFile) if len(location) > 1 else ModelFile
    return [field.alias or name for name, field in kind.model_fields.items()]


def _one_line(error: ValidationError, where: str) -> str:
    """First error in one line: file, key and correction."""
    first, *others = error.errors()
    if first["type"] == "missing":
        # A misspelt key is missing and unknown at once: the unknown key is the better message.
        wrong = (e for e in others if e["type"] == "extra_forbidden" and e["loc"][:-1] == first["loc"][:-1])
        first = next(wrong, first)
    location = first["loc"]
    key = ""
    for part in location:
        key += f"[{part}]" if isinstance(part, int) else f".{part}" if key else str(part)
    if first["type"] == "extra_forbidden":
        return f"{where}: unknown key '{key}'{did_you_mean_or_known(str(location[-1]), _known_keys(location))}"
    if first["type"] == "missing":
        return f"{where}: the key '{key}' is missing"
    message = first["msg"].removeprefix("Value error, ")
    given = first["input"]
    shown = f" (got {given!r})" if isinstance(given, int | float | str) else ""
    if first["type"] == "invalid_key" and isinstance(given, int | float):
        # YAML reads `inertia: 0,02` between braces as a key 2 of its own.
        message, shown = f"{given} in the place of a key; the decimal separator is a point: 0.02, not 0,02", ""
    return f"{where}: {key}: {message}{shown}"


def read_mapping(text: str, where: str) -> dict[str, Any]:
    """Read YAML 1.2 text whose top is a mapping. Raises InputError: not YAML, or not a mapping."""
    raw = read_yaml(text, where)
    if not isinstance(raw, dict):
        raise InputError(f"{where}: not a model file: the top must be a mapping with 'schema: {SCHEMA}'")
    return raw


def read_model_file(text: str, where: str) -> ModelFile:
    """Check the text of a model file.

    `text`: YAML.
    `where`: name of the file for error lines.
    Raises InputError: one line with file, key and correction.
    """
    raw = read_mapping(text, where)
    if raw.get("schema") != SCHEMA:
        raise InputError(f"{where}: schema: must be '{SCHEMA}' (got {raw.get('schema')!r})")
    try:
        return ModelFile.model_validate(raw)
    except ValidationError as error:
        raise InputError(_one_line(error, where)) from error
