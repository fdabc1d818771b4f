"""One input after the other for a reader, held against what no reader may do."""

from __future__ import annotations

import hashlib
import os
import resource
import shutil
import sys
import traceback
from pathlib import Path
from typing import Any

from readers import Reader

from idloop.errors import IdloopError

_WRITES = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC


# What reading an input may take [bytes]: it has at most two million itself.
_ROOM = 1 << 30


class ForbiddenError(BaseException):
    """Something that a reader must not do, and that no reader can turn into a line of its own."""


class Watch:
    """Refuses what a reader has no business with, wherever in the process it is tried."""

    def __init__(self, folder: Path) -> None:
        self._folder = os.path.realpath(folder)
        self.on = False
        sys.addaudithook(self._see)

    def _see(self, event: str, arguments: tuple[Any, ...]) -> None:
        if not self.on:
            return
        if event in ("pickle.find_class", "subprocess.Popen", "os.system", "socket.connect", "os.exec"):
            raise ForbiddenError(f"{event} {arguments[:2]}")
        if event == "open" and isinstance(arguments[0], str | bytes):
            mode, flags = arguments[1], arguments[2]
            if (isinstance(mode, str) and set(mode) & set("wax+")) or (mode is None and flags & _WRITES):
                self._inside(event, arguments[0])
        if event in ("os.mkdir", "os.rename", "os.remove", "os.rmdir", "os.truncate", "os.link", "os.symlink"):
            # A tree is removed by names within open folders, whose numbers come last.
            self._inside(event, arguments[0], arguments[-1] if event in ("os.remove", "os.rmdir") else -1)

    def _inside(self, event: str, path: str | bytes, folder: int = -1) -> None:
        where = "" if folder < 0 else os.path.realpath(f"/proc/self/fd/{folder}")
        place = os.path.realpath(os.path.join(where, os.fsdecode(path)))  # noqa: PTH118 (absolute names stay)
        if place != os.devnull and not place.startswith(self._folder + os.sep) and "__pycache__" not in place:
            raise ForbiddenError(f"{event} outside the target: {place}")


class Trial:
    """Reads one input after the other and keeps what breaks the reader."""

    def __init__(self, reader: Reader, folder: Path, keep: Path) -> None:
        self._reader, self._folder, self._keep = reader, folder, keep
        self._watch = Watch(folder)
        self._room = _most_memory() + _ROOM
        self.inputs = self.refused = 0
        self.findings: dict[str, str] = {}

    def __call__(self, data: bytes) -> None:
        """Read it."""
        place = self._folder / "input"
        emptied(place)
        path, target = place / f"input{self._reader.suffix}", place / "target"
        target.mkdir(parents=True)
        path.write_bytes(data)
        self.inputs += 1
        self._watch.on = True
        try:
            self._reader.read(path, target)
        except IdloopError as error:
            self.refused += 1
            if not str(error).strip():
                self._found(data, "refused without a line")
        except (Exception, ForbiddenError) as error:  # noqa: BLE001 (that is what is looked for)
            last = traceback.extract_tb(error.__traceback__)[-1]
            own = [f for f in traceback.extract_tb(error.__traceback__) if "idloop" in f.filename]
            at = f"{Path(own[-1].filename).name}:{own[-1].lineno}" if own else ""
            self._found(
                data,
                f"{type(error).__name__} in {Path(last.filename).name}:{last.lineno} from {at}: {str(error)[:120]}",
            )
        finally:
            self._watch.on = False
        taken = _most_memory()
        if taken > self._room:
            self._room = 2 * taken
            self._found(data, f"took {taken / 2**30:.1f} GiB")

    def _found(self, data: bytes, what: str) -> None:
        self._watch.on = False
        key = what.split(":", 2)[0] + what.partition(" from ")[2].split(": ")[0]
        if key in self.findings:
            return
        self._keep.mkdir(parents=True, exist_ok=True)
        name = f"{self._reader.name}-{hashlib.sha256(data).hexdigest()[:8]}"
        (self._keep / name).write_bytes(data)
        self.findings[key] = f"{name}: {' '.join(what.split())}"


def _most_memory() -> int:
    """What this process has taken at most so far [bytes]."""
    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def emptied(folder: Path) -> None:
    """Take a folder away, whatever is in it."""
    shutil.rmtree(folder, ignore_errors=True)
