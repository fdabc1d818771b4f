"""`idloop start`: from the files of a log to bags, a model file and a fit."""

from __future__ import annotations

import re
import sys
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import click

from idloop.cli import _inputs, _outputs
from idloop.cli._progress import progress
from idloop.errors import InputError

if TYPE_CHECKING:
    from idloop.api.log import Log

SIGNALS = {
    "time": "Column of the stamps, or a formula such as 'tick / 1000'.",
    "command": "Column of the force, torque, current, voltage or duty cycle; a number is a constant.",
    "position": "Column of the measured position; =counts/4096 is an encoder of 4096 counts per turn.",
    "velocity": "Column of the measured velocity.",
    "load": "Column of a second position, at the load behind a gear, belt or spring: a model of two bodies.",
    "effort": "Column of a measured force or current beside the command.",
    "reference": "Column of the set-point that a controller follows.",
    "temperature": "Column of a temperature.",
    "supply": "Column of the supply voltage.",
}
EXAMPLE = """\b
Examples:
  idloop start log.csv
  idloop start run1.csv run2.csv --position 'enc=counts/4096' --command u=V
  idloop start drive.csv encoder.csv --output my_axis    # one signal per file
"""
RATE = "rate"
_ROWS = re.compile(r"(\d*):(\d*)")
_DELIMITERS = {"tab": "\t", "\\t": "\t", "space": " ", "blank": " "}
_ACCEPTS, _REFUSES = ("", "y", "yes"), ("n", "no")
_PROMPT = "Enter to go on, SIGNAL=COLUMN[=UNIT] to change one (rate=HZ where there is no time), q to stop"


@click.command(epilog=EXAMPLE)
@click.argument("files", nargs=-1, required=True, metavar="FILE...", type=click.Path(path_type=Path))
@click.option("--output", type=_outputs.NEW_FOLDER, metavar="DIR", help="Folder to write.")
@click.option("--rate", type=click.FloatRange(0, min_open=True), metavar="HZ", help="Rows per second without a time.")
@click.option("--period", type=click.FloatRange(0, min_open=True), metavar="S", help="Seconds per row without a time.")
@_inputs.option("--joint", default="axis", metavar="NAME", help="Name to write for the joint.")
@click.option(
    "--delimiter",
    metavar="C",
    callback=lambda _context, _option, text: _delimiter(text),
    help="Character between the cells of a text file, such as ';'; 'tab' for a tab, ' ' for any white space.",
)
@click.option("--decimal", type=click.Choice([".", ","]), help="Decimal sign of a text file.")
@click.option("--skip-rows", type=click.IntRange(0), metavar="N", help="Lines above the header of a text file.")
@click.option(
    "--rows",
    multiple=True,
    metavar="FROM:TO",
    callback=lambda _context, _option, texts: [_slice(text) for text in texts],
    help="Rows of a table, or messages of the motion in a bag, counted from 0 without TO; each piece is a record of its"
    " own. Can be repeated.",
)
@click.option("--late", type=float, default=0.0, metavar="S", help="Seconds by which the command was recorded late.")
@click.option("--no-header", is_flag=True, help="The first line of a text file is data.")
@click.option("--no-fit", is_flag=True, help="Only write mapping, model and bags.")
@click.option("--yes", is_flag=True, help="Ask nothing on a terminal.")
@_outputs.work_options
def command(
    files: tuple[Path, ...],
    *,
    output: Path | None,
    rate: float | None,
    period: float | None,
    joint: str,
    delimiter: str | None,
    decimal: str | None,
    skip_rows: int | None,
    rows: list[slice],
    late: float,
    no_header: bool,
    no_fit: bool,
    yes: bool,
    as_json: bool,
    **signals: str | None,
) -> None:
    """Find out what the columns of FILE... are, import them, inspect them and fit a first model.

    Every guess is shown with its reason, and what is uncertain is marked with "check:". On a terminal you are asked
    before anything is written. Files with the same columns are records of one axis; files with different columns are
    one record with a signal or more in each. A column is given as COLUMN, COLUMN=UNIT, =UNIT, or as a formula such as
    'theta + alpha'; "none" leaves the signal out.
    """
    if rate is not None and period is not None:
        raise InputError("--rate and --period say the same: give one")
    layout = {
        "delimiter": delimiter,
        "decimal": decimal,
        "skip_rows": skip_rows,
        "header": False if no_header else None,
    }
    csv = {key: value for key, value in layout.items() if value is not None}
    given = {name: text for name, text in signals.items() if text is not None}
    period = 1.0 / rate if rate else period
    asked = not (yes or as_json) and _on_terminal()
    from idloop.api.log import recognise

    read = partial(recognise, files, csv=csv, rows=rows, late=late)
    found = _ask(read, given, period, output) if asked else read(given, period=period)
    from idloop.api.start import begin, free_folder

    if not (asked or as_json):
        # What was recognised is seen also where what follows is refused.
        free_folder(found, output)
        _outputs.print_blocks(found.blocks())
        click.echo()
    with progress("starting") as update:
        begun = begin(found, output, csv=csv, joint=joint, fitted=not no_fit, progress=update)
    if as_json:
        _outputs.print_json(begun.to_dict())
    else:
        _outputs.print_blocks(begun.outcome())
    if begun.fit is None and begun.done.asked:
        raise click.exceptions.Exit(1)


for name, text in reversed(SIGNALS.items()):
    command = click.option(f"--{name}", metavar="COLUMN[=UNIT]", help=text)(command)


def _delimiter(text: str | None) -> str | None:
    """Return the character that is meant; a shell passes on no tab that is typed."""
    found = _DELIMITERS.get(text.lower(), text) if text is not None else None
    if found is not None and (len(found) != 1 or found in '"\r\n'):
        raise InputError(f"--delimiter {text!r} is not one character; give one such as ';', or 'tab' for a tab")
    return found


def _on_terminal() -> bool:
    return sys.stdin.isatty() and sys.stdout.isatty()


def _slice(text: str) -> slice:
    """Rows that are given as FROM:TO."""
    if not (match := _ROWS.fullmatch(text.strip())):
        raise InputError(f"--rows {text!r} are none: give FROM:TO, such as 0:2000 or 2000:")
    return slice(*(int(one) if one else None for one in match.groups()))


def _ask(read: Callable[..., Log], given: dict[str, str], period: float | None, output: Path | None) -> Log:
    """Show what was recognised until the user accepts it."""
    from idloop.api.start import free_folder

    found: Log | None = None
    shown = given, period
    with tempfile.TemporaryDirectory(prefix="idloop_") as folder:
        while True:
            try:
                found = read(given, period=period)
            except InputError as error:
                _outputs.log(str(error))
                if found is not None:
                    # What was refused is not kept: the table that stands there is what will be fitted.
                    given, period = shown
                    _outputs.log("not changed: the table above holds")
            else:
                free_folder(found, output)
                shown = given, period
                _outputs.print_blocks(found.blocks())
                _outputs.log(f"picture: {_picture(found, Path(folder))}")
            answer = _answer(accepts=found is not None)
            if answer is None:
                assert found is not None  # noqa: S101  (else nothing is accepted)
                return found
            role, text = answer
            if role == RATE:
                period = period_of(text)
            else:
                given = {**given, role: text}


def _answer(*, accepts: bool) -> tuple[str, str] | None:
    """Ask until the answer is a signal and its column, or accepts what is shown: then None."""
    from idloop.api.log import check_signals

    while True:
        answer = click.prompt(_PROMPT, default="", show_default=False).strip()
        if answer == "q":
            raise click.exceptions.Exit(0)
        if answer.lower() in _ACCEPTS and accepts:
            return None
        role, equals, text = (word.strip() for word in answer.partition("="))
        if not equals:
            known = "" if answer.lower() in (*_ACCEPTS, *_REFUSES) else f"not understood: {answer!r}; "
            _outputs.log(f"{known}say what to change, such as position=angle=deg or command=u=V; q stops")
            continue
        try:
            if role == RATE:
                period_of(text)
            else:
                check_signals([role])
        except InputError as error:
            _outputs.log(str(error))
        else:
            return role, text


def period_of(rate: str) -> float:
    """Seconds per row for a number of rows per second. Raises InputError: it is none."""
    from idloop.records.tables.csv_layout import is_number

    if not (is_number(rate) and float(rate) > 0.0):
        raise InputError(f"{rate!r} rows per second are none; give a number above zero")
    return 1.0 / float(rate)


def _picture(found: Log, folder: Path) -> Path:
    from idloop.drawing import save
    from idloop.reporting.plots.recording import plot_recognition

    path = folder / "log.png"
    save(plot_recognition(found.recognition), path)
    return path
