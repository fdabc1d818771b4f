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
from idloop.errors import IdloopError, InputError
from idloop.records.formats.form import not_readable

# Time that a file may take [s], and bytes that are read in a second at least.
LONGEST, _SLOWEST = 30.0, 10_000_000
# Memory that it may take beyond what the process has [bytes].
_ROOM = 2 * MOST_TABLE
_SIZE = struct.Struct("<Q")
_KINDS = "biufcSU"  # of arrays that are sent
_ARRAY, _OBJECTS = "\0array", "\0objects"  # no names of a file have a zero


def read_isolated(path: Path, what: str, read: Callable[[], Any]) -> Any:
    """Return what a function reads in a process of its own: texts, numbers and arrays in mappings and lists.

    `what`: form of the file, for messages.
    Raises InputError: the function raised an error; or the process ended, or did not answer, since the file is damaged.
    """
    receive, send = os.pipe()
    with warnings.catch_warnings():
        # Of other threads: the child waits for none of their locks, and is ended when it does not answer.
        warnings.simplefilter("ignore", DeprecationWarning)
        child = os.fork()
    if child == 0:
        _answer(receive, send, lambda: _content_or_error(path, what, read))
    os.close(send)
    deadline = time.monotonic() + LONGEST + path.stat().st_size / _SLOWEST
    try:
        with cast("io.BufferedReader", io.BufferedReader(_Pipe(receive, deadline))) as stream:
            answer = _received(stream)
    except (EOFError, TimeoutError, ValueError, TypeError) as error:
        reason = "its reader does not come to an end" if isinstance(error, TimeoutError) else "its reader broke off"
        raise not_readable(path, what, reason) from None
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
    if "error" in answer:
        raise InputError(answer["error"])
    return answer["content"]


def _content_or_error(path: Path, what: str, read: Callable[[], Any]) -> dict[str, Any]:
    try:
        return {"content": read()}
    except IdloopError as error:
        return {"error": str(error)}
    except MemoryError:
        return {"error": f"{path}: its values take more than {MOST_TABLE >> 30} GiB; keep fewer of them"}
    except Exception as error:  # noqa: BLE001 - a library lets those of the format, of codecs, NumPy and Python through
        return {"error": str(not_readable(path, what, error))}


def _answer(receive: int, send: int, read: Callable[[], dict[str, Any]]) -> NoReturn:
    """Read, send and end; what the library prints is left out."""
    try:
        os.close(receive)
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, 1)
        os.dup2(null, 2)
        faulthandler.disable()
        _limit_memory()
        with os.fdopen(send, "wb") as stream:
            _send(stream, read())
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
    """Write JSON with the type and shape of each array in its place, and then the arrays."""
    arrays: list[NDArray[Any]] = []

    def packed(value: Any) -> Any:
        if isinstance(value, np.generic):
            value = value.item()
            return value if isinstance(value, str | int | float) else None
        if isinstance(value, Mapping):
            return dict(value)
        if not isinstance(value, np.ndarray):
            return None
        if value.dtype.kind == "O" and value.ndim == 1:
            return {_OBJECTS: list(value)}
        if value.dtype.kind not in _KINDS:
            return None
        arrays.append(value)
        return {_ARRAY: [value.dtype.str, value.shape]}

    text = json.dumps(content, default=packed).encode()
    stream.write(_SIZE.pack(len(text)) + text)
    stream.writelines(np.ascontiguousarray(array).tobytes() for array in arrays)


def _received(stream: io.BufferedReader) -> Any:
    def exactly(size: int) -> bytes:
        data = stream.read(size)
        if len(data) < size:
            raise EOFError
        return data

    def unpacked(found: dict[str, Any]) -> Any:
        if _OBJECTS in found:
            objects = np.empty(len(found[_OBJECTS]), object)
            for place, value in enumerate(found[_OBJECTS]):
                objects[place] = value
            return objects
        if _ARRAY not in found:
            return found
        dtype, shape = np.dtype(found[_ARRAY][0]), found[_ARRAY][1]
        size = math.prod(shape) * dtype.itemsize
        array = np.empty(math.prod(shape), dtype)
        array[:] = np.frombuffer(exactly(size), dtype) if size else array
        return array.reshape(shape)

    (size,) = _SIZE.unpack(exactly(_SIZE.size))
    return json.loads(exactly(size), object_hook=unpacked)
