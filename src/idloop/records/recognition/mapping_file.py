"""A mapping file from what was recognised, with the reason of each line."""

from __future__ import annotations

from io import StringIO
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap
from ruamel.yaml.scalarstring import LiteralScalarString

from idloop.records.recognition.guess import LOAD, MOTION, Guess
from idloop.records.recognition.recognise import Recognition
from idloop.records.tables.csv_file import SKIPPED
from idloop.records.tables.mapping import SCHEMA, Time

_CONDITIONS = ("temperature", "supply")


def mapping_of(found: Recognition, name: str, joint: str, *, files: tuple[str, ...] = ()) -> CommentedMap:
    """Return the mapping as it stands in a file, with comments; `files` are the names of those that are joined."""
    mapping = CommentedMap({"schema": SCHEMA, "name": name, "joint": joint})
    if files:
        mapping["files"] = list(files)
    if found.table.text is not None and found.table.text.skipped:
        mapping["csv"] = CommentedMap({"skip_text": True})
        note = next(one for one in found.table.notes if any(words in one for words in SKIPPED))
        mapping.yaml_add_eol_comment(_one_line(note), "csv")
    if not found.sources or found.base.time.stamps is not None:
        mapping["time"] = _time(found.base.time)
        mapping.yaml_add_eol_comment(_one_line(found.base.reason), "time")
    reference: dict[str, Any] = {}
    conditions: dict[str, Any] = {}
    for guess in found.guesses:
        channel = _channel(found, guess)
        if guess.role in _CONDITIONS:
            conditions[guess.role] = channel
        elif guess.role.startswith("reference"):
            reference["velocity" if guess.role.endswith("velocity") else "position"] = channel
        elif guess.role == LOAD:
            mapping["position"] = [mapping["position"], {**channel, "joint": load_of(joint)}]
        else:
            mapping[guess.role] = channel
            mapping.yaml_add_eol_comment(_one_line(guess.reason), guess.role)
    definitions = {name: LiteralScalarString(text) for name, text in found.definitions.items()}
    for key, section in (("reference", reference), ("conditions", conditions), ("definitions", definitions)):
        if section:
            mapping[key] = section
    return mapping


def load_of(joint: str) -> str:
    """Name of the load that a joint drives."""
    return LOAD if joint != LOAD else f"{LOAD}_side"


def text_of(mapping: CommentedMap) -> str:
    """Text of the file."""
    yaml = YAML()
    yaml.default_flow_style = None
    yaml.width = 200
    stream = StringIO()
    yaml.dump(mapping, stream)
    return stream.getvalue()


def _time(time: Time) -> dict[str, Any]:
    left_out = {"offset", "stretch", *({"unit"} if time.source is None else ())}
    return time.model_dump(exclude_none=True, exclude=left_out)


def _channel(found: Recognition, guess: Guess) -> dict[str, Any]:
    channel: dict[str, Any] = {}
    if not {"compute", "value", "file_name"} & set(guess.options):
        channel |= found.sources.get(guess.column, {"column": guess.column})
    channel |= guess.options
    if guess.unit:
        channel["unit"] = guess.unit
    if guess.column in found.clocks and not found.sources:
        channel["time"] = _time(found.clocks[guess.column])
    return channel


def _one_line(text: str) -> str:
    return " ".join(text.split())[:120]


def motion_of(found: Recognition) -> list[Guess]:
    """Measured position and velocity."""
    return [one for one in found.guesses if one.role in MOTION]
