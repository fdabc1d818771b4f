"""Readers of YAML, JSON and NPZ documents, with limits on their size.

A file of a few hundred bytes can need any amount of memory and time: nested aliases, nested brackets, an integer of a
million digits, compressed arrays of zeros. Each limit is checked before objects are built.
"""

from __future__ import annotations

import json
import warnings
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ruamel.yaml import YAML
from ruamel.yaml.constructor import ConstructorError, SafeConstructor
from ruamel.yaml.error import MarkedYAMLError, YAMLError, YAMLWarning
from ruamel.yaml.events import (
    AliasEvent,
    CollectionEndEvent,
    CollectionStartEvent,
    Event,
    NodeEvent,
    ScalarEvent,
)
from ruamel.yaml.nodes import Node, ScalarNode
from ruamel.yaml.parser import Parser, ParserError

from idloop.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Exceptions from the evaluation of a damaged document.
NOT_WHOLE = (LookupError, ArithmeticError, AttributeError, TypeError, ValueError)

# Most characters of a YAML document: a model file has 2,000, the metadata of a recording in 1,000 files 300,000.
MOST_YAML = 4 << 20
# Most values in it, with those of aliases: ten seconds of reading; the metadata of 1,000 files has 10,000.
MOST_VALUES = 200_000
# Most bytes of a JSON document other than a table: a ladder of ten steps has 1 MB.
MOST_JSON = 64 << 20
# Most lists and mappings of a JSON document, such as samples as mappings; one takes 100 to 300 bytes.
MOST_LISTS = 10_000_000
# Deepest nesting, for recursive functions: a model file has 4 levels, a report 10.
MOST_DEPTH = 64
# Most digits of a number: 250 hexadecimal ones are 1,000 of the 1,024 binary digits of a double.
MOST_DIGITS = 250
# Most characters of the name of a joint or topic, the limit of DDS.
MOST_NAME = 255
# Most bytes of a table in memory, unpacked, eight for a number: 10 million rows of 26 columns.
MOST_TABLE = 2 << 30
# Most bytes of a table in JSON: numbers take four times as much memory as characters, lists twenty times.
MOST_JSON_TABLE = MOST_TABLE // 8
# Most columns of a table: a data logger has 1,000.
MOST_COLUMNS = 10_000

_NUMBER_TAGS = ("tag:yaml.org,2002:int", "tag:yaml.org,2002:float")


def read_text(path: Path, most: int = MOST_YAML) -> str:
    """Read a file as UTF-8.

    Parameters
    ----------
    path : Path
    most : int
        Bytes that it may have.

    Raises
    ------
    InputError
        It cannot be read, is no text, or is longer.
    """
    try:
        with path.open("rb") as stream:
            content = stream.read(most + 1)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error}); check the path") from error
    if len(content) > most:
        raise InputError(f"{path}: longer than {most:,} bytes; check that this is the file")
    try:
        return content.decode("utf-8")
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: cannot be read (not a text file in UTF-8); check that this is the file") from error


def read_yaml(text: str, where: str) -> Any:
    """Read a YAML 1.2 document.

    `where`: name of the file for error lines.
    Raises InputError: not YAML, or beyond a limit of this module.
    """
    try:
        return LimitedYAML().load(text)
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line = f" line {mark.line + 1}:" if mark else ""
        raise InputError(f"{where}:{line} not valid YAML: {_first_line(error.problem)}") from error
    except YAMLError as error:
        raise InputError(f"{where}: not valid YAML: {_first_line(error)}") from error


def read_json(text: str, where: str, most: int = MOST_JSON) -> Any:
    """Read a JSON document.

    `where`: name of the file for error lines.
    `most`: characters that it may have.
    Raises InputError: not JSON, or beyond a limit of this module.
    """
    if len(text) > most:
        raise InputError(f"{where}: longer than {most:,} characters; check that this is the file")
    if text.count("[") + text.count("{") > MOST_LISTS:
        raise InputError(f"{where}: more than {MOST_LISTS:,} lists and mappings; check that this is the file")
    try:
        content = json.loads(text, parse_int=_whole_number)
        _check_tree(content)
    except RecursionError:
        raise InputError(f"{where}: not valid JSON ({_TOO_DEEP}); check the copy of the file") from None
    except ValueError as error:
        raise InputError(f"{where}: not valid JSON ({error}); check the copy of the file") from error
    return content


def read_npz(path: Path, most: int, objects: list[str] | None = None) -> dict[str, NDArray[Any]]:
    """Read the arrays of an NPZ file; pickled objects are never opened.

    `most`: bytes that they may take in memory.
    `objects`: gets the names of arrays of objects, which are left out; without it they are refused.
    Raises InputError: it cannot be read, or takes more.
    """
    import zipfile

    import numpy as np

    try:
        with zipfile.ZipFile(path) as archive:
            # No more than these sizes is unpacked.
            stated = sum(entry.file_size for entry in archive.infolist())
        if stated <= most:
            with np.load(path, allow_pickle=False) as content:
                names = content.files
                if objects is not None:
                    objects += [name for name in names if _holds_objects(content.zip, name)]
                    names = [name for name in names if name not in objects]
                return {name: content[name] for name in names}
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error}); check the path") from None
    except Exception as error:  # noqa: BLE001 - the library lets those of zip, zlib and Python through
        text = _first_line(error) or type(error).__name__
        raise InputError(f"{path}: not a readable NPZ file ({text}); check the copy of the file") from None
    raise InputError(f"{path}: it unpacks to {stated / 2**30:.3g} GiB, more than {most / 2**30:.3g}; keep fewer arrays")


def _holds_objects(archive: Any, name: str) -> bool:
    """Whether an array of an NPZ file holds objects of Python, by its header."""
    import numpy as np

    entry = f"{name}.npy" if f"{name}.npy" in archive.namelist() else name
    with archive.open(entry) as stream:
        one = np.lib.format.read_magic(stream) == (1, 0)
        header = np.lib.format.read_array_header_1_0 if one else np.lib.format.read_array_header_2_0
        return bool(header(stream)[2].hasobject)


# Characters of a text that count as one value.
_ONE_VALUE = 64
_TOO_DEEP = f"lists and mappings more than {MOST_DEPTH} deep"
_TOO_LONG = f"a number of more than {MOST_DIGITS} digits"
_TOO_MANY = f"more than {MOST_VALUES:,} values, with those that aliases stand for"
_NO_TEXT = "half of a surrogate pair, which is no character"


def _first_line(text: object) -> str:
    return " ".join(str(text).strip().partition("\n")[0].split())


def _whole_number(digits: str) -> int:
    if len(digits) > MOST_DIGITS:
        raise ValueError(_TOO_LONG)
    return int(digits)


def is_text(text: str) -> bool:
    """Whether a text can be encoded: half of a surrogate pair cannot."""
    if text.isascii():
        return True
    try:
        text.encode("utf-8")
    except UnicodeEncodeError:
        return False
    return True


def _check_tree(content: Any) -> None:
    """Raise ValueError for a document that is nested too deeply, or a text that cannot be encoded."""
    open_: list[tuple[Any, int]] = [([content], 0)]
    while open_:
        several, depth = open_.pop()
        if depth > MOST_DEPTH:
            raise ValueError(_TOO_DEEP)
        for one in several:
            kind = type(one)
            if kind is str:
                if not is_text(one):
                    raise ValueError(_NO_TEXT)
            elif kind is list:
                open_.append((one, depth + 1))
            elif kind is dict:
                if not all(map(is_text, one)):
                    raise ValueError(_NO_TEXT)
                open_.append((one.values(), depth + 1))


@dataclass
class _Size:
    """Number and depth of the values in a list or mapping, with those of aliases."""

    anchor: str | None = None
    values: int = 1
    depth: int = 0

    def add(self, inner: _Size) -> None:
        self.values += inner.values
        self.depth = max(self.depth, inner.depth + 1)


class _LimitedParser(Parser):
    """Parser that counts events before objects are built."""

    def __init__(self, loader: Any) -> None:
        super().__init__(loader)
        self._open = [_Size()]
        self._anchored: dict[str, _Size] = {}
        self._values = 0

    def get_event(self) -> Event:
        event: Event = super().get_event()
        if isinstance(event, CollectionStartEvent):
            self._open.append(_Size(event.anchor))
            self._check(event, _Size())
        elif isinstance(event, CollectionEndEvent):
            self._add(self._open.pop())
        elif isinstance(event, ScalarEvent):
            if not is_text(event.value):
                raise ParserError(None, None, _NO_TEXT, event.start_mark)
            size = _Size(event.anchor, 1 + len(event.value) // _ONE_VALUE)
            self._check(event, size)
            self._add(size)
        elif isinstance(event, AliasEvent):
            if any(one.anchor == event.anchor for one in self._open):
                raise ParserError(None, None, f"the alias *{event.anchor} is recursive", event.start_mark)
            again = self._anchored.get(event.anchor, _Size())
            self._check(event, again)
            self._add(replace(again, anchor=None))
        return event

    def _check(self, event: NodeEvent, size: _Size) -> None:
        self._values += size.values
        if self._values > MOST_VALUES:
            raise ParserError(None, None, _TOO_MANY, event.start_mark)
        if len(self._open) - 1 + size.depth > MOST_DEPTH:
            raise ParserError(None, None, _TOO_DEEP, event.start_mark)

    def _add(self, size: _Size) -> None:
        self._open[-1].add(size)
        if size.anchor is not None:
            self._anchored[size.anchor] = size


class _LimitedConstructor(SafeConstructor):
    """Constructor that gives the line of an invalid value: a number of a million digits, the 45th of a month."""

    def construct_object(self, node: Node, deep: bool = False) -> Any:
        if isinstance(node, ScalarNode) and str(node.tag) in _NUMBER_TAGS and len(node.value) > MOST_DIGITS:
            raise ConstructorError(None, None, _TOO_LONG, node.start_mark)
        try:
            return super().construct_object(node, deep=deep)
        except YAMLError:
            raise
        except Exception as error:
            text = f"{str(node.value)[:40]!r} is not a valid value ({_first_line(error) or type(error).__name__})"
            raise ConstructorError(None, None, text, node.start_mark) from error


class LimitedYAML(YAML):
    """A reader of YAML 1.2 that makes plain objects, within the limits of this module."""

    def __init__(self, *, typ: str = "safe", pure: bool = True) -> None:
        super().__init__(typ=typ, pure=pure)
        self.Parser, self.Constructor = _LimitedParser, _LimitedConstructor

    def load(self, stream: Any) -> Any:
        """Read one document.

        Raises
        ------
        YAMLError
            Not YAML, or beyond a limit.
        """
        if len(stream) > MOST_YAML:
            raise YAMLError(f"longer than {MOST_YAML:,} characters")
        try:
            with warnings.catch_warnings():
                # Warnings about a valid document are several lines each.
                warnings.simplefilter("ignore", YAMLWarning)
                return super().load(stream)
        except YAMLError:
            raise
        except Exception as error:  # of the library, for a damaged document
            raise YAMLError(_first_line(error) or type(error).__name__) from error
