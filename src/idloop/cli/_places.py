"""Where results go: every place is probed before the work begins, and written at its end."""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, TypeVar

import click

from idloop.errors import IdloopError, InputError

Function = TypeVar("Function", bound=Callable[..., Any])

PLOT_SUFFIXES = (".png", ".svg", ".pdf")
_TAKEN = "idloop.places"  # of this command line, in click's notes


# ---------------------------------------------------------------- kinds of places


class OutputFile(click.ParamType[Path]):
    """A file that the verb will write.

    Parameters
    ----------
    suffixes : sequence of str
        What it may end in; anything when empty.
    replaces : bool
        A file that is there is written anew without being asked: figures and pages, which the verb makes again.
        Else it takes `--force`.
    """

    name = "FILE"

    def __init__(self, suffixes: Sequence[str] = (), *, replaces: bool = False) -> None:
        self.suffixes = tuple(suffixes)
        self.replaces = replaces

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Path:
        """Probe the place: before the work is done, not after it."""
        what = _what(param)
        if ctx is not None and ctx.resilient_parsing:  # a shell completes the line
            return Path(value)
        path = probe_file(
            Path(value),
            what,
            suffixes=self.suffixes,
            overwrite=self.replaces or _forced(ctx),
            forcible=not self.replaces,
        )
        return _reserve(path, what, ctx)


class OutputFolder(click.ParamType[Path]):
    """A folder that the verb will write into, made where it is not there.

    Parameters
    ----------
    new : bool
        One that is there is refused.
    parents : bool
        Folders above it are made as well.
    """

    name = "DIR"

    def __init__(self, *, new: bool = False, parents: bool = False) -> None:
        self.new = new
        self.parents = parents

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Path:
        """Probe the place: before the work is done, not after it."""
        what = _what(param)
        if ctx is not None and ctx.resilient_parsing:
            return Path(value)
        return _reserve(probe_folder(Path(value), what, new=self.new, parents=self.parents), what, ctx)


OUTPUT_FILE = OutputFile()
OUTPUT_FOLDER = OutputFolder()
NEW_FOLDER = OutputFolder(new=True, parents=True)
PLOT = OutputFile(PLOT_SUFFIXES, replaces=True)


def force_option(text: str) -> Callable[[Function], Function]:
    """Add `--force`, which every `OutputFile` of the verb asks for; `text` is its help."""
    # Eager: known before the file is probed, wherever it stands on the command line.
    return click.option("--force", is_flag=True, is_eager=True, help=text)


def _what(param: click.Parameter | None) -> str:
    # An argument that may be left out has brackets around its name.
    name = "" if param is None else param.human_readable_name.strip("[]")
    return param.opts[0] if isinstance(param, click.Option) else name


def _forced(context: click.Context | None) -> bool:
    return context is not None and bool(context.params.get("force"))


def _reserve(path: Path, what: str, context: click.Context | None) -> Path:
    """Refuse a place that another option of this command line has taken: one result would be lost."""
    if context is not None:
        taken: dict[str, str] = context.meta.setdefault(_TAKEN, {})
        other = taken.setdefault(os.path.realpath(path), what)
        if other != what:
            raise InputError(f"{what} {path}: {other} goes there too, name another place for one of them")
    return path


# ---------------------------------------------------------------- probes


def probe_file(
    path: Path, what: str, *, suffixes: Sequence[str] = (), overwrite: bool = False, forcible: bool = True
) -> Path:
    """Return `path` when a file can be written there; what is there stays as it is.

    Parameters
    ----------
    path : Path
    what : str
        What names it in the message: the option.
    suffixes : sequence of str
        What it may end in; anything when empty.
    overwrite : bool
        A file that is there may be written anew.
    forcible : bool
        The verb has `--force`.

    Raises
    ------
    InputError
        It cannot, or a file is there already.
    """
    with _told(path, what):
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

    Parameters
    ----------
    path : Path
    what : str
        What names it in the message: the option.
    new : bool
        A folder that is there is refused.
    parents : bool
        Folders above it are made as well.

    Raises
    ------
    InputError
        They cannot, or something is there already.
    """
    with _told(path, what):
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
def _told(path: Path, what: str) -> Iterator[None]:
    """Say in one line why a place cannot be written."""
    try:
        yield
    except OSError as error:
        raise InputError(f"{what} {path}: cannot be written ({error.strerror or error}), name another place") from error


def _one_of(words: Sequence[str]) -> str:
    return words[0] if len(words) == 1 else f"one of {', '.join(words)}"


# ---------------------------------------------------------------- writing


def write_text(path: Path, text: str) -> None:
    """Write a file whose place was probed.

    Raises
    ------
    IdloopError
        When it cannot be written after all.
    """
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise IdloopError(f"cannot write {path}: {error.strerror or error}") from error


def make_folder(path: Path, *, parents: bool = False) -> Path:
    """Make a folder whose place was probed, where it is not there.

    Raises
    ------
    IdloopError
        When it cannot be made after all.
    """
    try:
        path.mkdir(parents=parents, exist_ok=True)
    except OSError as error:
        raise IdloopError(f"cannot make {path}: {error.strerror or error}") from error
    return path
