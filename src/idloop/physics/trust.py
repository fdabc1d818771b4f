"""Trust in effect files: which folders of Python files may run.

Reading a model runs the Python files in the folder ``effects`` beside it. The user therefore trusts each folder once
(``idloop trust``); its checksum is stored, and a changed, added or removed file requires trust again, as with direnv.
A copy under that checksum is run, so that neither a file that is changed after the check nor machine code beside the
files can run.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import shlex
import shutil
import stat
import tempfile
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

from idloop.documents import MOST_YAML, read_text
from idloop.errors import InputError
from idloop.spelling import listed

# Most effect files of a folder.
_MOST_FILES = 1_000
# Folder and checksum.
Allowed: TypeAlias = tuple[Path, str]
# Folders that callers of the library have allowed in this process.
_ALLOWED: set[Allowed] = set()


@dataclass(frozen=True)
class EffectFiles:
    """The Python files of a folder as they are now."""

    folder: Path  # resolved path
    sources: dict[str, bytes]  # content by name

    @property
    def checksum(self) -> str:
        """SHA-256 of names and contents."""
        total = hashlib.sha256()
        for name, source in sorted(self.sources.items()):
            total.update(f"{len(source)} {name}\n".encode("utf-8", "surrogateescape") + source)
        return total.hexdigest()

    @property
    def effects(self) -> list[str]:
        """Names of the files with effects; those that begin with an underscore are helpers."""
        return sorted(name for name in self.sources if not name.startswith("_"))


@dataclass(frozen=True)
class TrustedFolder:
    """A trusted folder."""

    folder: Path
    state: str  # one of `trusted`, `changed`, `gone`: whether its files are still those that were trusted


def read_effect_files(folder: Path) -> EffectFiles:
    """Read the Python files of a folder; none where there is no such folder.

    Raises InputError: a file that cannot be read, or too many files.
    """
    folder = folder.resolve()
    paths = sorted(path for path in folder.glob("*.py") if path.is_file())
    if len(paths) > _MOST_FILES:
        raise InputError(f"{folder}: more than {_MOST_FILES:,} Python files; this is no folder of effects")
    return EffectFiles(folder, {path.name: read_text(path, MOST_YAML).encode() for path in paths})


def check_trusted(files: EffectFiles) -> None:
    """Refuse to run files that are not trusted.

    Raises InputError: the folder was never trusted, or its files have changed since.
    """
    if not files.effects or (files.folder, files.checksum) in _ALLOWED:
        return
    known = _read(_record(files.folder))
    if known == (files.folder, files.checksum):
        return
    why = "which are not trusted" if known is None else "which have changed since they were trusted"
    raise InputError(
        f"{files.folder}: the model would run the Python files in this folder ({listed(files.effects)}), {why}; look at"
        f" them, then run: idloop trust {shlex.quote(str(files.folder))}"
    )


def trust(files: EffectFiles) -> None:
    """Trust these files. Raises InputError: the record cannot be written."""
    _write(_record(files.folder), f"{files.checksum}\n".encode() + os.fsencode(files.folder))


def revoke(folder: Path) -> None:
    """Revoke the trust in a folder. Raises InputError: it is not trusted."""
    path = _record(folder.resolve())
    known = _read(path)
    if known is None:
        raise InputError(f"{folder}: is not trusted; `idloop trust --list` names what is")
    path.unlink(missing_ok=True)
    shutil.rmtree(_copies(*known), ignore_errors=True)


def trusted_folders() -> list[TrustedFolder]:
    """List the trusted folders. Raises InputError: a record cannot be read."""
    found = []
    for path in sorted((_ours() / "trusted").glob("*")):
        if (known := _read(path)) is not None:
            folder, checksum = known
            same = folder.is_dir() and read_effect_files(folder).checksum == checksum
            found.append(TrustedFolder(folder, "trusted" if same else "changed" if folder.is_dir() else "gone"))
    return sorted(found, key=lambda one: one.folder)


def allow(folder: Path) -> None:
    """Trust the present files of a folder in this process."""
    files = read_effect_files(folder)
    _ALLOWED.add((files.folder, files.checksum))


def allowed(folders: Iterable[Path]) -> tuple[Allowed, ...]:
    """Folders among these that are allowed in this process, for `allow_again` in a worker process."""
    wanted = [folder.resolve() for folder in folders] if _ALLOWED else []
    return tuple(one for one in _ALLOWED if one[0] in wanted)


def allow_again(several: Iterable[Allowed]) -> None:
    """Allow the folders that the parent process has allowed."""
    _ALLOWED.update(several)


def kept_copy(files: EffectFiles, name: str) -> Path:
    """Private copy of one of the files, beside which machine code is cached.

    Raises InputError: it cannot be written.
    """
    path = _copies(files.folder, files.checksum) / name
    if not path.is_file():
        _write(path, files.sources[name])
    return path


def _copies(folder: Path, checksum: str) -> Path:
    # One place for each folder: cached machine code contains the name of its module, which depends on the folder.
    return _ours() / "effects" / hashlib.sha256(os.fsencode(folder) + checksum.encode()).hexdigest()


def _record(folder: Path) -> Path:
    return _ours() / "trusted" / hashlib.sha256(os.fsencode(folder)).hexdigest()


def _ours() -> Path:
    """Folder beneath ``$XDG_STATE_HOME`` for records and copies, which no other user may write into."""
    given = Path(os.environ.get("XDG_STATE_HOME", ""))
    ours = (given if given.is_absolute() else Path.home() / ".local" / "state") / "idloop"
    with contextlib.suppress(OSError):  # a missing folder is created later
        found = ours.stat()
        if found.st_uid != os.geteuid() or found.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
            raise InputError(f"{ours}: others can write into this folder, which records trusted files; remove it")
    return ours


def _read(path: Path) -> tuple[Path, str] | None:
    """Folder and checksum of a record; None without one."""
    try:
        checksum, _, folder = path.read_bytes().partition(b"\n")
    except (FileNotFoundError, NotADirectoryError):
        return None
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error}); remove it") from None
    return Path(os.fsdecode(folder)), checksum.decode("ascii", "replace")


def _write(path: Path, content: bytes) -> None:
    """Write a file atomically, readable by its user alone."""
    ours = _ours()
    try:
        ours.parent.mkdir(parents=True, exist_ok=True)
        for folder in (ours, *reversed([one for one in path.parents if ours in one.parents])):
            folder.mkdir(mode=0o700, exist_ok=True)
        descriptor, name = tempfile.mkstemp(dir=path.parent, prefix=".")
        with os.fdopen(descriptor, "wb") as file:
            file.write(content)
        Path(name).replace(path)
    except OSError as error:
        raise InputError(
            f"{path.parent}: cannot be written ({error.strerror or error}); set XDG_STATE_HOME to a folder that can"
        ) from None
