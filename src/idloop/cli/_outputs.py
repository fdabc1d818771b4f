"""What the verbs print and write: JSON, tables and figures, and the places of files, probed before the work begins."""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import click

from idloop.cli._command_line import Function, kept, kept_option, together
from idloop.errors import InputError
from idloop.json_values import to_json
from idloop.output_files import probe_file, probe_folder
from idloop.reporting.text.blocks import Block, Table, as_text

PLOT_SUFFIXES = (".png", ".svg", ".pdf")
_TAKEN = "idloop.places"  # of this command line, in click's notes


# ---------------------------------------------------------------- places


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
        if ctx is not None and ctx.resilient_parsing:  # a shell completes the line
            return Path(value)
        what, overwrite = _what(param), self.replaces or forced()
        path = probe_file(Path(value), what, suffixes=self.suffixes, overwrite=overwrite, forcible=not self.replaces)
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
        if ctx is not None and ctx.resilient_parsing:
            return Path(value)
        what = _what(param)
        return _reserve(probe_folder(Path(value), what, new=self.new, parents=self.parents), what, ctx)


OUTPUT_FILE = OutputFile()
OUTPUT_FOLDER = OutputFolder()
NEW_FOLDER = OutputFolder(new=True, parents=True)
PLOT = OutputFile(PLOT_SUFFIXES, replaces=True)


def _what(param: click.Parameter | None) -> str:
    # An argument that may be left out has brackets around its name.
    name = "" if param is None else param.human_readable_name.strip("[]")
    return param.opts[0] if isinstance(param, click.Option) else name


def _reserve(path: Path, what: str, context: click.Context | None) -> Path:
    """Refuse a place that another option of this command line has taken: one result would be lost."""
    if context is not None:
        taken: dict[str, str] = context.meta.setdefault(_TAKEN, {})
        other = taken.setdefault(os.path.realpath(path), what)
        if other != what:
            raise InputError(f"{what} {path}: {other} goes there too, name another place for one of them")
    return path


# ---------------------------------------------------------------- options

json_option = click.option("--json", "as_json", is_flag=True, help="Print one JSON document on stdout, nothing else.")
plot_option = click.option("--plot", type=PLOT, metavar="FILE", help="Write the figure (.png, .svg, .pdf).")
# Of work that takes a while, whose progress `idloop.cli._progress` says.
work_options = together(kept_option("--quiet", is_flag=True, help="Do not say how far the work is."), json_option)
drawn_work_options = together(plot_option, work_options)


def force_option(text: str) -> Callable[[Function], Function]:
    """Add `--force`, for `forced`; `text` is its help."""
    # Eager: known before the file is probed, wherever it stands on the command line.
    return kept_option("--force", is_flag=True, is_eager=True, help=text)


def forced() -> bool:
    """Whether files that are there may be overwritten."""
    return bool(kept("force"))


def output_option(metavar: str, text: str, kind: OutputFile = OUTPUT_FILE) -> Callable[[Function], Function]:
    """Add `--output`, a file, and `--force`."""
    output = click.option("--output", type=kind, metavar=metavar, help=text)
    return together(output, force_option("Overwrite the file of --output."))


def output_folder_option(text: str) -> Callable[[Function], Function]:
    """Add `--output`, a folder, and `--force`."""
    output = click.option("--output", type=OUTPUT_FOLDER, metavar="DIR", help=text)
    return together(output, force_option("Overwrite the files in the folder of --output."))


# ---------------------------------------------------------------- results


def print_json(document: Any) -> None:
    """Print the one document of a verb called with `--json`."""
    click.echo(json.dumps(to_json(document), indent=2, ensure_ascii=False, allow_nan=False))


def deliver(found: Any, *, as_json: bool, plot: Path | None, output: Path | None = None, **more: Any) -> None:
    """Save a result and its figure where files are asked for, and print its document with `more`, or its text."""
    if output is not None:
        found.save(output)
    print_either(found.blocks, {**found.to_dict(), "output": output, "plot": plot, **more} if as_json else None)
    log_written(output)
    save_plot(found.plot, plot)


def print_rows(header: Sequence[str], rows: Iterable[Sequence[str]], document: Any, *, as_json: bool) -> None:
    """Print a table, or the document that says the same."""
    print_either(lambda: [Table.of(header, rows)], document if as_json else None)


def print_either(blocks: Callable[[], Iterable[Block]], document: Any) -> None:
    """Print a document, or the text where there is none."""
    if document is None:
        print_blocks(blocks())
    else:
        print_json(document)


def save_plot(draw: Callable[[], Any], path: Path | None) -> None:
    """Draw a figure, write it and say so, where a file is asked for."""
    if path is not None:
        from idloop.drawing import save

        save(draw(), path)
        log_written(path)


def log_written(*paths: Path | None) -> None:
    """Name the files that were written, those that were asked for."""
    for path in paths:
        if path is not None:
            log(f"written: {path}")


def log(text: str) -> None:
    """Write one line for the reader on stderr, where it disturbs neither tables nor JSON."""
    with contextlib.suppress(OSError):  # the terminal may be gone
        click.echo(text, err=True)


def print_table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Print a table: words to the left, numbers to the right."""
    print_blocks([Table.of(header, rows)])


def print_blocks(blocks: Iterable[Block]) -> None:
    """Print paragraphs and tables."""
    click.echo(as_text(blocks))
