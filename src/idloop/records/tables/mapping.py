"""The mapping file: which column of a foreign file becomes which signal."""

from __future__ import annotations

import functools
import re
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationError,
    field_validator,
    model_validator,
)

from idloop.arrays import Array
from idloop.documents import MOST_NAME, read_text, read_yaml
from idloop.errors import InputError
from idloop.records.tables.expression import Expression
from idloop.records.tables.table import Table
from idloop.spelling import check_known, did_you_mean, did_you_mean_or_known, listed

SCHEMA = "idloop/mapping/1"
Name = Annotated[str, Field(max_length=MOST_NAME)]
_MOST_CHANNELS = 100  # columns of one kind of signal, each of another joint
# Stamps are whole nanoseconds [s].
_SHORTEST, _LONGEST = 1e-9, 1e9
_MOST_SKIPPED = 1_000_000  # lines of a file that may be left out at its beginning
Finite = Annotated[float, Field(allow_inf_nan=False)]


def _checked_formula(value: str) -> str:
    try:
        Expression(value)
    except InputError as error:
        raise ValueError(str(error)) from None
    return value


def _checked_pattern(value: str) -> str:
    try:
        groups = re.compile(value).groups
    except re.error as error:
        raise ValueError(f"{value!r} is no regular expression ({error})") from None
    if groups != 1:
        raise ValueError(rf"{value!r} must have one group for the number, such as 'pwm_(\d+)'")
    return value


Formula = Annotated[Name, AfterValidator(_checked_formula)]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, populate_by_name=True)


class SignBit(_Strict):
    """Sign-magnitude integer: this bit set means negative, the bits below are the magnitude."""

    sign_bit: int = Field(ge=1, le=62)


Decoding = Literal["int8", "int16", "int32"] | SignBit  # how a signed integer was stored as an unsigned one


class Time(_Strict):
    """Where stamps come from: a column, a formula over columns, a fixed period, or the stamps of a bag."""

    column: str | int | None = None
    unit: Literal["s", "ms", "us", "ns", "iso8601"] = "s"
    compute: Formula | None = None
    period: float | None = Field(default=None, ge=_SHORTEST, allow_inf_nan=False)
    rate: float | None = Field(default=None, gt=0, le=1.0 / _SHORTEST, allow_inf_nan=False)
    stamps: Literal["header", "receive"] | None = None
    # Of a clock that began at another time, or runs at another rate: t becomes first + offset + stretch (t - first).
    offset: float = Field(default=0.0, ge=-_LONGEST, le=_LONGEST, allow_inf_nan=False)
    stretch: float = Field(default=1.0, ge=0.5, le=2.0, allow_inf_nan=False)

    @model_validator(mode="after")
    def _one_source(self) -> Time:
        if sum(item is not None for item in (self.source, self.period, self.rate, self.stamps)) != 1:
            raise ValueError("give one of column, period, rate, compute (tables) or stamps (bags)")
        if self.compute is not None and (self.column is not None or self.unit == "iso8601"):
            raise ValueError("compute: a formula stands in the place of a column and gives numbers, not dates")
        return self

    @property
    def source(self) -> str | int | None:
        """Column or formula of the stamps; None without."""
        return self.column if self.column is not None else self.compute

    def read(self, table: Table, rows: slice = slice(None)) -> Array:
        """Return the numbers of the column or the formula, shape (n,), in `unit`."""
        if self.compute is None:
            return table.numbers(self.column, rows)  # type: ignore[arg-type]
        formula = Expression(self.compute)
        return formula.evaluate({name: table.numbers(name, rows) for name in formula.columns})


_TABLE_SOURCES = ("column", "compute", "value", "file_name")


class Channel(_Strict):
    """One signal: value = decode(raw) * scale * times + offset."""

    column: str | int | None = None  # column of a table, by name or position
    compute: Formula | None = None  # formula over columns of a table, see `Expression`
    value: Finite | None = None  # a constant, such as a command that is in no column
    # Regular expression whose group is that constant in the name of the file: ``pwm_(\d+)``
    file_name: Annotated[Name, AfterValidator(_checked_pattern)] | None = None
    time: Time | None = None  # stamps of this signal alone, where the signals have several time bases
    # Of a bag: topic and path of the number in its messages (``pos_estimate``, ``data[0]``), or of a JointState topic
    # the field, with `source_joint`
    topic: Name | None = None
    field: Name | None = None
    source_joint: Name | None = None
    joint: Name | None = None  # joint that it becomes; the mapping's `joint` by default
    unit: Name = ""  # unit after scale and offset; written in that of the topics (rad, m, V, A, ...), see `base_units`
    # Linear conversion; a negative scale turns the sign
    scale: Finite = 1.0
    offset: Finite = 0.0
    times: str | int | None = None  # a second column that multiplies the first (duty times supply voltage)
    decode: Decoding | None = None
    # Range after which an encoder repeats, in `unit`; the position is unwrapped
    wrap: float | None = Field(default=None, gt=0, allow_inf_nan=False)
    optional: bool = False  # do without when the file lacks the column

    @model_validator(mode="after")
    def _one_source(self) -> Channel:
        if sum(getattr(self, source) is not None for source in (*_TABLE_SOURCES, "topic")) != 1:
            raise ValueError("give either one of column, compute, value and file_name (of a table) or topic (of a bag)")
        return self

    @property
    def is_constant(self) -> bool:
        """Whether it is one number."""
        return self.value is not None or self.file_name is not None


def _as_channel(value: Any) -> Any:
    """Accept a bare column name."""
    return {"column": value} if isinstance(value, str | int) else value


def _as_channels(value: Any) -> Any:
    """Accept a bare column name, one channel, or a list of them."""
    return list(map(_as_channel, value if isinstance(value, list) else [value]))


Channels = Annotated[list[Channel], Field(max_length=_MOST_CHANNELS), BeforeValidator(_as_channels)]


def _is_signal(value: Any) -> bool:
    """Whether a value is a signal itself, not a section of signals."""
    if isinstance(value, dict):
        return bool({*_TABLE_SOURCES, "topic"} & set(value)) and "position" not in value
    return isinstance(value, str | int | list)


class Reference(_Strict):
    """What the controller follows; a bare signal is its position."""

    position: Channels = []
    velocity: Channels = []

    @model_validator(mode="before")
    @classmethod
    def _bare_position(cls, value: Any) -> Any:
        return {"position": value} if _is_signal(value) else value


class Excitation(_Strict):
    """What is added to the position reference or to the command."""

    position: Channels = []
    effort: Channels = []

    @model_validator(mode="before")
    @classmethod
    def _says_where(cls, value: Any) -> Any:
        if _is_signal(value):
            raise ValueError(
                "name what the signal is added to: `excitation: {effort: ...}` for the command,"
                " `excitation: {position: ...}` for the reference"
            )
        return value


class Rows(_Strict):
    """Rows start <= k < stop, counted from 0."""

    start: int = Field(default=0, ge=0)
    stop: int | None = Field(default=None, gt=0)


class Times(_Strict):
    """Stamps start <= t < stop [s], of a table as the file counts them, of a bag from the first one that is used."""

    start: Finite | None = None
    stop: Finite | None = None


class Signals(_Strict):
    """What a mapping, or one part of it, assigns."""

    joint: Name | None = None
    time: Time | None = None
    command: Channels = []
    position: Channels = []
    velocity: Channels = []
    effort: Channels = []
    reference: Reference = Reference()
    excitation: Excitation = Excitation()
    conditions: dict[Name, Annotated[Channel, BeforeValidator(_as_channel)]] = Field(
        default={}, max_length=_MOST_CHANNELS
    )
    rows: Rows = Rows()
    times: Times = Times()


class Part(Signals):
    """One record of a file that holds several; its keys replace those of the mapping."""

    description: str = ""


class Csv(_Strict):
    """Format of a CSV file; detected where not given."""

    delimiter: str | None = None
    header: bool | None = None
    skip_rows: int | None = Field(default=None, ge=0, le=_MOST_SKIPPED)
    decimal: Literal[".", ","] = "."
    skip_text: bool = False

    @field_validator("delimiter")
    @classmethod
    def _one_character(cls, value: str | None) -> str | None:
        if value is not None and (len(value) != 1 or value in '"\r\n'):
            raise ValueError("must be one character, such as ;; left out, or a blank, any white space is one")
        return value


class Mapping(Signals):
    """A whole mapping file, schema ``idloop/mapping/1``."""

    schema_name: Literal["idloop/mapping/1"] = Field(alias="schema")
    name: Name
    description: str = ""
    cite: str = ""
    format: (
        Literal[
            "csv", "mat", "hdf5", "parquet", "feather", "npz", "npy", "torch", "wpilog", "mcap_json", "codesys", "lvm",
            "twincat", "tektronix", "sysid", "jsonl", "json", "blocks", "echo", "labels", "bag",
        ]
        | None
    ) = None  # fmt: skip
    csv: Csv = Csv()
    entries: str | None = None
    files: Annotated[list[Name], Field(max_length=_MOST_CHANNELS)] = []
    attributes: list[str] = []
    notes: list[str] = []
    definitions: dict[str, str] = {}
    parts: dict[str, Part] = {}

    def for_part(self, part: str | None) -> Signals:
        """Return the signals of one part, the mapping's own where it has none; refuse an unknown part."""
        if not self.parts:
            if part is not None:
                raise InputError(f"mapping {self.name}: it has no parts, leave --part {part} out")
            return self
        if part is None:
            raise InputError(
                f"mapping {self.name}: the file holds several records; choose one with --part: {listed(self.parts, 20)}"
            )
        check_known(part, self.parts, f"mapping {self.name}: no part", 20)
        own = self.parts[part]
        sources = {name: own if name in own.model_fields_set else self for name in Signals.model_fields}
        return Signals.model_construct(**{name: getattr(source, name) for name, source in sources.items()})


def ready_mappings() -> dict[str, Path]:
    """Return the mappings shipped with idloop by name."""
    folder = files("idloop.records") / "mappings"
    paths = sorted(Path(str(entry)) for entry in folder.iterdir() if entry.name.endswith(".yaml"))
    return {path.stem: path for path in paths}


@functools.cache
def ready_definitions() -> dict[str, str]:
    """Message types that the ready mappings define; read once, because this takes longer than reading many a bag."""
    return {name: text for ready in ready_mappings() for name, text in load_mapping(ready).definitions.items()}


def load_mapping(name_or_path: str | Path) -> Mapping:
    """Load a mapping: one shipped with idloop by its name, or a file of the user's.

    Raises InputError: unknown name, unreadable YAML, unknown or wrong keys.
    """
    known = ready_mappings()
    path = known.get(str(name_or_path), Path(name_or_path))
    if not path.is_file():
        raise InputError(
            f"no data set or mapping file {str(name_or_path)!r}; ready sets are"
            f" {listed(known)}{did_you_mean(str(name_or_path), known)}"
        )
    return parse_mapping(read_yaml(read_text(path), str(path)), str(path))


def parse_mapping(content: Any, where: str) -> Mapping:
    """Validate the content of a mapping file; InputError names file, key and correction."""
    if not isinstance(content, dict):
        raise InputError(f"{where}: a mapping file is a YAML mapping that starts with `schema: {SCHEMA}`")
    if content.get("schema") != SCHEMA:
        raise InputError(f"{where}: schema is {content.get('schema')!r}; it must be {SCHEMA}")
    try:
        return Mapping.model_validate(content)
    except ValidationError as error:
        raise InputError(f"{where}: {_explain(error)}") from None


_SECTIONS: dict[str, type[BaseModel]] = {
    "time": Time,
    "reference": Reference,
    "excitation": Excitation,
    "rows": Rows,
    "times": Times,
    "csv": Csv,
    "decode": SignBit,
}


def _keys_at(place: list[str]) -> list[str]:
    """Return the keys that are allowed at a place of the file, which is given by the keys that lead to it."""
    model: type[BaseModel] = Mapping
    if place:
        within_part = place[0] == "parts" and len(place) <= 2
        model = Part if within_part else _SECTIONS.get(place[-1], Channel)
    return [field.alias or name for name, field in model.model_fields.items()]


def _explain(error: ValidationError) -> str:
    first = error.errors()[0]
    # The location also contains names of our classes between the keys; its last part is always a key.
    *parents, last = first["loc"] or ("mapping",)
    place = [str(part) for part in parents if not (isinstance(part, str) and part[:1].isupper())] + [str(last)]
    key = ".".join(place)
    if first["type"] == "extra_forbidden":
        known = _keys_at([part for part in place[:-1] if not part.isdigit()])
        return f"unknown key {key}{did_you_mean_or_known(place[-1], known)}"
    if first["type"] == "missing":
        return f"key {key} is missing"
    text = str(first["msg"]).removeprefix("Value error, ")
    return f"{key or 'mapping'}: {text[:1].lower() + text[1:]}"
