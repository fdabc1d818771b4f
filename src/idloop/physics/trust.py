"""Which effect files may run: a folder's, once its user has said so, and only as they were then.

An effect file is Python: whoever reads a model runs what lies in the folder ``effects`` beside it. So the user says
once for each folder that its files may run (``idloop trust``); their checksum is kept, and a file that was changed,
added or removed asks again, as direnv does. What runs is a copy under that checksum: neither a file that is changed
between the look and the run, nor compiled code that somebody left beside the files, ever does.
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

# Effect files of a folder: the catalogue itself has 28.
_MOST_FILES = 1_000
# Folder and checksum.
Allowed: TypeAlias = tuple[Path, str]
# What callers of the library have allowed in this process.
_ALLOWED: set[Allowed] = set()


@dataclass(frozen=True)
class EffectFiles:
    """The Python files of a folder as they are now.

    Attributes
    ----------
    folder : Path
        Without links.
    sources : dict of str to bytes
        Content by name.
    """

    folder: Path
    sources: dict[str, bytes]

    @property
    def checksum(self) -> str:
        """SHA-256 of names and contents."""
        total = hashlib.sha256()
        for name, source in sorted(self.sources.items()):
            total.update(f"{len(source)} {name}\n".encode("utf-8", "surrogateescape") + source)
        return total.hexdigest()

    @property
    def effects(self) -> list[str]:
        """Names of the files that hold effects: those with an underscore are helpers."""
        return sorted(name for name in self.sources if not name.startswith("_"))


@dataclass(frozen=True)
class TrustedFolder:
    """A folder that was trusted.

    Attributes
    ----------
    folder : Path
    state : {"trusted", "changed", "gone"}
        Whether its files are those that were trusted.
    """

    folder: Path
    state: str


def read_effect_files(folder: Path) -> EffectFiles:
    """Read the Python files of a folder; none where there is no such folder.

    Raises
    ------
    InputError
        A file that cannot be read, or more than any folder of effects has.
    """
    folder = folder.resolve()
    paths = sorted(path for path in folder.glob("*.py") if path.is_file())
    if len(paths) > _MOST_FILES:
        raise InputError(f"{folder}: more than {_MOST_FILES:,} Python files; this is no folder of effects")
    return EffectFiles(folder, {path.name: read_text(path, MOST_YAML).encode() for path in paths})


def check_trusted(files: EffectFiles) -> None:
    """Refuse to run files that nobody has trusted.

    Raises
    ------
    InputError
        The folder was never trusted, or its files have changed since.
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
    """Remember that these files may run.

    Raises
    ------
    InputError
        It cannot be remembered.
    """
    _write(_record(files.folder), f"{files.checksum}\n".encode() + os.fsencode(files.folder))


def revoke(folder: Path) -> None:
    """Forget that a folder was trusted.

    Raises
    ------
    InputError
        It was not.
    """
    path = _record(folder.resolve())
    known = _read(path)
    if known is None:
        raise InputError(f"{folder}: is not trusted; `idloop trust --list` names what is")
    path.unlink(missing_ok=True)
    shutil.rmtree(_copies(known[1]), ignore_errors=True)


def trusted_folders() -> list[TrustedFolder]:
    """Name every folder that was trusted.

    Raises
    ------
    InputError
        What was remembered cannot be read.
    """
    found = []
    for path in sorted((_ours() / "trusted").glob("*")):
        if (known := _read(path)) is not None:
            folder, checksum = known
            same = folder.is_dir() and read_effect_files(folder).checksum == checksum
            found.append(TrustedFolder(folder, "trusted" if same else "changed" if folder.is_dir() else "gone"))
    return sorted(found, key=lambda one: one.folder)


def allow(folder: Path) -> None:
    """Let the files of a folder run in this process, as they are now."""
    files = read_effect_files(folder)
    _ALLOWED.add((files.folder, files.checksum))


def allowed(folders: Iterable[Path]) -> tuple[Allowed, ...]:
    """What of some folders is allowed in this process, for `allow_again` in another one of ours."""
    wanted = [folder.resolve() for folder in folders] if _ALLOWED else []
    return tuple(one for one in _ALLOWED if one[0] in wanted)


def allow_again(several: Iterable[Allowed]) -> None:
    """Allow what another process of ours has allowed."""
    _ALLOWED.update(several)


def kept_copy(files: EffectFiles, name: str) -> Path:
    """A copy of one of the files that only its user can write: machine code is cached beside it.

    Raises
    ------
    InputError
        It cannot be written.
    """
    path = _copies(files.checksum) / name
    if not path.is_file():
        _write(path, files.sources[name])
    return path


def _copies(checksum: str) -> Path:
    return _ours() / "effects" / checksum


def _record(folder: Path) -> Path:
    return _ours() / "trusted" / hashlib.sha256(os.fsencode(folder)).hexdigest()


def _ours() -> Path:
    """Folder beneath ``$XDG_STATE_HOME`` in which all of this is kept.

    Raises
    ------
    InputError
        Others could write into it.
    """
    given = Path(os.environ.get("XDG_STATE_HOME", ""))
    ours = (given if given.is_absolute() else Path.home() / ".local" / "state") / "idloop"
    with contextlib.suppress(OSError):  # then it can neither be read nor written
        found = ours.stat()
        if found.st_uid != os.geteuid() or found.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
            raise InputError(f"{ours}: others can write into this folder, which says what may run; remove it")
    return ours


def _read(path: Path) -> tuple[Path, str] | None:
    """Folder and checksum of a record; None where there is none."""
    try:
        checksum, _, folder = path.read_bytes().partition(b"\n")
    except (FileNotFoundError, NotADirectoryError):
        return None
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error}); remove it") from None
    return Path(os.fsdecode(folder)), checksum.decode("ascii", "replace")


def _write(path: Path, content: bytes) -> None:
    """Write a file in one go, readable by its user alone."""
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
