"""Where results go: every place is probed before the work begins, and written at its end."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeVar

import click

from idloop.errors import InputError
from idloop.output_files import probe_file, probe_folder

Function = TypeVar("Function", bound=Callable[..., Any])

PLOT_SUFFIXES = (".png", ".svg", ".pdf")
_TAKEN = "idloop.places"  # of this command line, in click's notes


# ---------------------------------------------------------------- kinds of places


class OutputFile(click.ParamType[Path]):
    """A file that the verb will write.

    `suffixes`: what it may end in; anything when empty. `replaces`: a file that is there is written anew without being
    asked: figures and pages, which the verb makes again. Else it takes `--force`.
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

    `new`: one that is there is refused; `parents`: folders above it are made as well.
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
