"""A library of C reads a damaged file in a process of its own, whose end is one line.

The library of HDF5 ends the process, or never returns, for one of some thousand damaged files; scipy's compiled reader
of MAT files ends it at a tag that names no type; that of Arrow may. A forked process costs 10 ms, and nothing that it
sends is executed: arrays as bytes, the rest as JSON.
"""

from __future__ import annotations

import contextlib
import faulthandler
import io
import json
import math
import os
import resource
import select
import signal
import struct
import time
import warnings
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, BinaryIO, NoReturn, cast

import numpy as np
from numpy.typing import NDArray

from idloop.documents import MOST_TABLE
from idloop.errors import InputError

# Time that a file may take [s], and bytes that are read in a second at least.
LONGEST, _SLOWEST = 30.0, 10_000_000
# Memory that it may take beyond what the process has [bytes].
_ROOM = 2 * MOST_TABLE
_SIZE = struct.Struct("<Q")
_KINDS = "biufcSU"


def read_isolated(path: Path, what: str, read: Callable[[], Any]) -> Any:
    """Return what a function reads, which runs in a process of its own.

    `path`: the file.
    `what`: its form, for messages.
    `read`: returns texts, numbers and arrays in mappings and lists.
    Raises InputError: the function raised it; or the process ended, or did not answer, since the file is damaged.
    """
    receive, send = os.pipe()
    with warnings.catch_warnings():
        # Of other threads: the child waits for none of their locks, and is ended when it does not answer.
        warnings.simplefilter("ignore", DeprecationWarning)
        child = os.fork()
    if child == 0:
        _answer(receive, send, read)
    os.close(send)
    deadline = time.monotonic() + LONGEST + path.stat().st_size / _SLOWEST
    try:
        with cast("io.BufferedReader", io.BufferedReader(_Pipe(receive, deadline))) as stream:
            answer = _received(stream)
    except (EOFError, TimeoutError) as error:
        reason = "its reader does not come to an end" if isinstance(error, TimeoutError) else "its reader broke off"
        raise InputError(f"{path}: not a readable {what} file ({reason}); check the copy of the file") from None
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
    if "error" in answer:
        raise InputError(answer["error"])
    return answer["content"]


def _answer(receive: int, send: int, read: Callable[[], Any]) -> NoReturn:
    """Read, send and end; what the library prints is left out."""
    try:
        os.close(receive)
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, 1)
        os.dup2(null, 2)
        faulthandler.disable()
        _limit_memory()
        with os.fdopen(send, "wb") as stream:
            try:
                answer = {"content": read()}
            except InputError as error:
                answer = {"error": str(error)}
            _send(stream, answer)
    finally:
        os._exit(0)


def _limit_memory() -> None:
    taken = Path("/proc/self/statm")
    if taken.is_file():
        most = int(taken.read_text(encoding="ascii").split()[0]) * resource.getpagesize() + _ROOM
        _, hard = resource.getrlimit(resource.RLIMIT_AS)
        resource.setrlimit(resource.RLIMIT_AS, (most if hard < 0 else min(most, hard), hard))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


class _Pipe(io.RawIOBase):
    """The end of a pipe that is read from, until a time."""

    def __init__(self, place: int, deadline: float) -> None:
        self._place, self._deadline = place, deadline

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        left = max(0.0, self._deadline - time.monotonic())
        if not select.select([self._place], [], [], left)[0]:
            raise TimeoutError
        return os.readv(self._place, [buffer])

    def close(self) -> None:
        if not self.closed:
            os.close(self._place)
        super().close()


def _send(stream: BinaryIO, content: Any) -> None:
    arrays: list[NDArray[Any]] = []
    text = json.dumps(_packed(content, arrays)).encode()
    stream.write(_SIZE.pack(len(text)) + text)
    stream.writelines(np.ascontiguousarray(array).tobytes() for array in arrays)


def _packed(content: Any, arrays: list[NDArray[Any]]) -> list[Any]:
    """Return what JSON holds, with the type and shape of each array in its place."""
    if isinstance(content, np.ndarray):
        if content.dtype.kind == "O" and content.ndim == 1:
            return ["objects", [_packed(value, arrays) for value in content]]
        if content.dtype.kind not in _KINDS:
            return ["value", None]
        arrays.append(content)
        return ["array", content.dtype.str, content.shape]
    if isinstance(content, Mapping):
        return ["mapping", {str(name): _packed(value, arrays) for name, value in content.items()}]
    if isinstance(content, list | tuple):
        if all(isinstance(one, str | int | float | type(None)) for one in content):
            return ["value", list(content)]
        return ["list", [_packed(value, arrays) for value in content]]
    value = content.item() if isinstance(content, np.generic) else content
    return ["value", value if isinstance(value, str | int | float) else None]


def _received(stream: io.BufferedReader) -> Any:
    (size,) = _SIZE.unpack(_exactly(stream, _SIZE.size))
    return _unpacked(json.loads(_exactly(stream, size)), stream)


def _unpacked(packed: list[Any], stream: io.BufferedReader) -> Any:
    kind, *rest = packed
    if kind == "mapping":
        return {name: _unpacked(value, stream) for name, value in rest[0].items()}
    if kind == "list":
        return [_unpacked(value, stream) for value in rest[0]]
    if kind == "objects":
        objects = np.empty(len(rest[0]), object)
        for place, value in enumerate(rest[0]):
            objects[place] = _unpacked(value, stream)
        return objects
    if kind == "array":
        dtype, shape = np.dtype(rest[0]), tuple(rest[1])
        array = np.empty(math.prod(shape), dtype)
        array[:] = np.frombuffer(_exactly(stream, array.nbytes), dtype) if array.nbytes else array
        return array.reshape(shape)
    return rest[0]


def _exactly(stream: io.BufferedReader, size: int) -> bytes:
    data = stream.read(size)
    if len(data) < size:
        raise EOFError
    return data
