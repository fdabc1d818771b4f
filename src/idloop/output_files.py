"""Files and folders that results go to: probed before the work begins, written at its end."""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path

from idloop.errors import IdloopError, InputError


def probe_file(
    path: Path, what: str, *, suffixes: Sequence[str] = (), overwrite: bool = False, forcible: bool = True
) -> Path:
    """Return `path` when a file can be written there; what is there stays as it is.

    `what`: what names it in the message: the option.
    `suffixes`: what it may end in; anything when empty.
    `overwrite`: a file that is there may be written anew.
    `forcible`: the verb has `--force`.
    Raises InputError: it cannot, or a file is there already.
    """
    with _one_line(path, what):
        if path.is_dir():
            raise InputError(f"{what} {path}: this is a folder, name a file")
        if suffixes and path.suffix.lower() not in suffixes:
            raise InputError(f"{what} {path}: the suffix must be {_one_of(suffixes)}")
        _check_parent(path, what)
        there = path.exists()
        if there and not overwrite:
            force = " or add --force" if forcible else ""
            raise InputError(f"{what} {path}: the file is there already, name another{force}")
        # Where a link points to nothing, its target is what will be made.
        target = os.path.realpath(path)
        if not there:
            os.close(os.open(target, os.O_WRONLY | os.O_CREAT | os.O_EXCL))
            Path(target).unlink()
        elif path.is_file():
            os.close(os.open(target, os.O_WRONLY))
    return path


def probe_folder(path: Path, what: str, *, new: bool = False, parents: bool = False) -> Path:
    """Return `path` when files can be written in such a folder; nothing is left behind.

    `what`: what names it in the message: the option.
    `new`: a folder that is there is refused.
    `parents`: folders above it are made as well.
    Raises InputError: they cannot, or something is there already.
    """
    with _one_line(path, what):
        if new and (path.exists() or path.is_symlink()):
            raise InputError(f"{what} {path}: exists already and is not overwritten, name another")
        if path.exists() and not path.is_dir():
            raise InputError(f"{what} {path}: this is a file, name a folder")
        if not parents:
            _check_parent(path, what)
        missing = [folder for folder in (path, *path.parents) if not folder.exists()]
        made: list[Path] = []
        try:
            for folder in reversed(missing):
                folder.mkdir()
                made.append(folder)
            with tempfile.TemporaryFile(dir=path):
                pass
        finally:
            for folder in reversed(made):
                with contextlib.suppress(OSError):
                    folder.rmdir()
    return path


def _check_parent(path: Path, what: str) -> None:
    if not path.parent.exists():
        raise InputError(f"{what} {path}: there is no folder {path.parent}, make it first")
    if not path.parent.is_dir():
        raise InputError(f"{what} {path}: {path.parent} is a file and not a folder, name another place")


@contextlib.contextmanager
def _one_line(path: Path, what: str) -> Iterator[None]:
    """Say in one line why a place cannot be written."""
    try:
        yield
    except OSError as error:
        raise InputError(f"{what} {path}: cannot be written ({error.strerror or error}), name another place") from error


def _one_of(words: Sequence[str]) -> str:
    return words[0] if len(words) == 1 else f"one of {', '.join(words)}"


def write_text(path: Path, text: str) -> None:
    """Write a text; errors as for `writing`."""
    with writing(path):
        path.write_text(text, encoding="utf-8")


@contextlib.contextmanager
def writing(path: Path) -> Iterator[None]:
    """Raise an IdloopError that names `path` when the system does not let it be written."""
    try:
        yield
    except OSError as error:
        raise IdloopError(f"cannot write {path}: {error.strerror or error}") from error


def make_folder(path: Path, *, parents: bool = False) -> Path:
    """Make a folder whose place was probed, where it is not there.

    Raises IdloopError: when it cannot be made after all.
    """
    try:
        path.mkdir(parents=parents, exist_ok=True)
    except OSError as error:
        raise IdloopError(f"cannot make {path}: {error.strerror or error}") from error
    return path
