"""`idloop fleet`: the joints of many robots over time, on Dask, into Parquet."""

from __future__ import annotations

import re
import threading
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from idloop.cli import _inputs, _outputs
from idloop.cli._progress import progress
from idloop.errors import IdloopError, InputError

if TYPE_CHECKING:
    from idloop.api.fleet import Fleet
    from idloop.physics import Model

EXAMPLE = """\b
Examples:
  idloop fleet recordings.csv --model base=base.yaml --model wrist=wrist.yaml --output runs/fleet
  idloop fleet bags/fleet --model 'j[1-3]=base.yaml' --model 'j*=wrist.yaml' --output runs/fleet --since 2026-03-15
  idloop fleet s3://robots/recordings.parquet --model joint.yaml --output runs/fleet --cluster tcp://scheduler:8786
  idloop fleet bags/fleet --model joint.yaml --output runs/fleet --watch
"""


@click.command(cls=_inputs.lists("--model"), epilog=EXAMPLE)
@click.argument("source", metavar="TABLE_OR_FOLDER")
@click.option(
    "--model",
    "models",
    multiple=True,
    required=True,
    metavar="[KIND=]MODEL",
    help="Model of a kind of joints, a file or a preset; KIND is a name of the table or a pattern of joint names.",
)
@click.option(
    "--output", type=_outputs.OutputFolder(parents=True), required=True, metavar="DIR", help="Folder of the results."
)
@click.option("--since", metavar="DATE", help="Compare the recordings from this date on with those before.")
@click.option("--against", metavar="DATE", help="First date of the earlier period [the first one that there is].")
@_inputs.option("--level", type=float, default=0.05, help="Rate of false discoveries.")
@_inputs.option(
    "--diagnose",
    default="5",
    metavar="NUMBER|all",
    help="So many of the worst joints go through the catalogue of effects, each at a level of 1 %, and get a report.",
)
@click.option("--watch", is_flag=True, help="Follow the place in which recordings land, until Ctrl-C.")
@_inputs.option("--period", type=click.FloatRange(0.1), default=10.0, help="Of --watch [s].")
@click.option("--workers", type=click.IntRange(min=0), help="Processes on this machine (default: one for each core).")
@_inputs.option("--memory", default="2GB", metavar="SIZE", help="Limit of each process.")
@click.option("--cluster", metavar="ADDRESS", help="Scheduler of Dask, in place of processes here.")
@_inputs.option("--seed", type=int, default=0, help="Equal seeds give equal answers.")
@_inputs.trust_option
@_outputs.drawn_work_options
def command(
    source: str,
    models: tuple[str, ...],
    *,
    output: Path,
    watch: bool,
    period: float,
    diagnose: str,
    memory: str,
    plot: Path | None,
    as_json: bool,
    **given: Any,
) -> None:
    """Identify the joints of many robots over time, and say which differ, which change, and what changed since a date.

    TABLE_OR_FOLDER is a table (.csv, .parquet) with the columns robot, joint, time, bag, and kind if wanted, a folder
    of ROBOT/DATE/BAG, a pattern, or an address of these. What is in the folder of --output already is not done again:
    the same command goes on where it was interrupted, and takes in what is new.

    Findings are odd joints (size: beside the mean of their kind; date: first recording outside of 95 % of it), trends
    (change from the first recording to the last; date: the last), steps (change at their date) and days (a recording
    beside the course of its joint), each with its 95 % interval; alarms of wear have the growth since their date.
    """
    from idloop.fleet.bags import check_place

    check_place(source)
    from idloop.api.fleet import identify_fleet, watch_fleet

    if not re.fullmatch(r"\d+(\.\d+)?\s*[kMGT]?i?B", memory):
        raise InputError(f"--memory {memory}: write a size, such as 2GB")
    if diagnose != "all" and not diagnose.isdigit():
        raise InputError(f"--diagnose {diagnose}: give a number of joints, or all")
    if watch and as_json:
        raise InputError("--watch prints after every look, --json one document: use one of them")
    several = _models(models)
    options = {"memory": memory, "diagnose": diagnose if diagnose == "all" else int(diagnose), **given}

    def show(fleet: Fleet) -> None:
        fleet.save(plot)
        _outputs.deliver(fleet, as_json=as_json, plot=plot)
        _outputs.log_written(output / "fleet.html")

    try:
        if watch:
            _outputs.log(f"watching {source}; Ctrl-C ends it")
            ended = threading.Event()
            watch_fleet(source, several, output, ended=ended, on_change=show, period=period, **options)
        else:
            with progress(f"fleet {source}", writes=True) as update:
                found = identify_fleet(source, several, output, progress=update, **options)
            show(found)
            if not found.components:
                raise IdloopError(f"{source}: nothing was identified; the reasons are listed and kept in {output}")
    except KeyboardInterrupt:
        if watch:
            _outputs.log(f"ended; what was found is in {output}")
            return
        kept = f"interrupted: what was finished is kept in {output}; the same command goes on from there"
        raise KeyboardInterrupt(kept) from None


def _models(given: tuple[str, ...]) -> dict[str, Model]:
    """Models by kind; one without a kind is that of all other joints."""
    found: dict[str, Model] = {}
    for text in given:
        kind, equals, source = text.partition("=")
        kind, source = (kind.strip(), source) if equals else ("*", text)
        if not kind or not source:
            raise InputError(f"--model {text}: write KIND=MODEL, such as wrist=wrist.yaml")
        if kind in found:
            raise InputError(f"--model {text}: there is a model for {kind} already")
        found[kind] = _inputs.open_model(source)
    # The pattern of all joints comes last: the first that matches counts.
    return dict(sorted(found.items(), key=lambda one: one[0] == "*"))
