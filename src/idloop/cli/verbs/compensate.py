"""`idloop compensate`: what it gains to cancel the effects of a fitted model in the controller."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from idloop.cli._common import (
    MODEL,
    apply_options,
    json_option,
    log,
    model_options,
    number,
    plot_option,
    print_json,
    print_table,
)
from idloop.cli._places import NEW_FOLDER, OUTPUT_FILE, force_option, write_text
from idloop.cli._progress import progress, quiet_option
from idloop.errors import InputError

if TYPE_CHECKING:
    from idloop.cli._tracking_runs import Loops, Reference
    from idloop.control import Controller
    from idloop.control.compensation import Compensation
    from idloop.control.tracking import Tracking
    from idloop.physics import Model

SCHEMA = "idloop/compensate/1"
EXAMPLE = """\b
Examples:
  idloop compensate fitted.yaml --plot gained.png
  idloop compensate fitted.yaml --plant dc_motor --plant-effect 'dead_zone@input(width=0.5)'
  idloop compensate fitted.yaml --reference '{name: sine, frequency: 0.2, amplitude: 1.0}' --only dead_zone
  idloop compensate fitted.yaml --plant machine.xml --graph --bags bags/compensated
\b
Use it: the controller node takes a fitted model, or the file of --output, as its parameter `compensation`.
"""
_POSITIVE = click.FloatRange(min=0.0, min_open=True)
_STANDS = 0.01  # of the motion of the reference: an axis that moves less is held


@click.command(epilog=EXAMPLE)
@click.argument("model", type=MODEL, metavar="MODEL")
@model_options
@click.option("--only", multiple=True, metavar="NAME[@SITE]", help="Cancel this effect only. May be repeated.")
@click.option(
    "--plant", metavar="MODEL|FILE.xml", help="The machine: a model, or an MJCF file. Left out: as MODEL says."
)
@click.option(
    "--plant-effect", multiple=True, metavar="NAME@SITE[(...)]", help="Add an effect to the machine. May be repeated."
)
@click.option(
    "--reference",
    metavar="SIGNAL|BAG",
    help="What is followed: a signal as YAML, or the reference of a bag. Left out: moves to and fro.",
)
@click.option("--controller", metavar="YAML|FILE", help="Controller in place of the model's, as text or in a file.")
@click.option("--limit", type=_POSITIVE, help="Most that is added to the command; left out, half of its limit.")
@click.option("--velocity-width", type=_POSITIVE, help="Speed below which dry friction is cancelled in part.")
@click.option("--command-width", type=_POSITIVE, help="Command below which a dead zone is crossed in part.")
@click.option("--crossing-time", type=_POSITIVE, help="Time in which a gap is crossed, in seconds.")
@click.option(
    "--settle",
    type=click.FloatRange(min=0.0),
    default=1.0,
    show_default=True,
    help="Seconds at the beginning that do not count.",
)
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Of the measurement noise.")
@click.option("--no-noise", is_flag=True, help="Sensors without noise.")
@click.option("--graph", is_flag=True, help="Run the nodes, once without and once with, and read their bags.")
@click.option("--bags", type=NEW_FOLDER, metavar="FOLDER", help="Keep the bags of --graph in a new folder.")
@click.option("--domain", type=click.IntRange(0, 232), help="ROS domain of --graph alone (ROS_DOMAIN_ID).")
@click.option("--output", type=OUTPUT_FILE, metavar="FILE", help="Write the compensator for the controller node.")
@force_option("Overwrite the file of --output.")
@plot_option
@quiet_option
@json_option
def command(
    model: Model,
    *,
    settings: tuple[str, ...],
    effects: tuple[str, ...],
    only: tuple[str, ...],
    plant: str | None,
    plant_effect: tuple[str, ...],
    reference: str | None,
    controller: str | None,
    limit: float | None,
    velocity_width: float | None,
    command_width: float | None,
    crossing_time: float | None,
    settle: float,
    seed: int,
    no_noise: bool,
    graph: bool,
    bags: Path | None,
    domain: int | None,
    output: Path | None,
    force: bool,
    plot: Path | None,
    as_json: bool,
) -> None:
    """Follow a reference without and with compensation by MODEL, and say by how much the error falls.

    The controller cancels what it can of the effects that MODEL has: command effects by their inverse, forces along
    the reference, gaps when the reference turns round. The machine may be another one than MODEL says, which is the
    honest case: fit first, then compensate the machine that was fitted.
    """
    from idloop.cli import _tracking_runs as runs
    from idloop.control import build_controller
    from idloop.control.compensation import Compensation

    if bags is not None and not graph:
        raise InputError("--bags goes with --graph: a simulation records nothing")
    chosen = apply_options(model, settings, effects)
    section = runs.controller_section(chosen, controller)
    chosen = runs.with_controller(chosen, section)
    compensation = Compensation(chosen, only, limit, velocity_width, command_width, crossing_time)
    built = build_controller(section, compensation=compensation)
    if not built.inputs:
        raise InputError("the controller has no feedback and follows nothing: give another one with --controller")
    machine = runs.machine_of(plant, plant_effect, chosen)
    path = runs.make_reference(reference, chosen, section)
    if settle >= (len(path.path) - 1) * built.sample_time:
        raise InputError(f"--settle {settle:g} s leaves nothing of the reference: shorten it")
    options: dict[str, Any] = {"seed": seed, "noise": not no_noise}
    if graph:
        from idloop.cli._tracking_graph import run_loops

        loops = run_loops(machine, compensation, section, path, bags=bags, domain=domain, **options)
    else:
        with progress("following the reference") as update:
            loops = runs.simulate_loops(machine, compensation, section, path, progress=update, **options)
    if output is not None:
        from idloop.exporters.compensator import export_compensation

        write_text(output, export_compensation(compensation).text)
        log(f"written: {output}")
    if plot is not None:
        from idloop.drawing import save
        from idloop.reporting.plots.tracking import plot_tracking

        names = chosen.input.name, chosen.input.unit
        shown = plot_tracking(loops.without, loops.compensated, _followed(built), *names, settle)
        save(shown, plot)
        log(f"written: {plot}")
    if as_json:
        print_json(
            {
                **_document(compensation, built, loops, path, settle),
                "plant": plant,
                "plant_effects": plant_effect,
                "run": "graph" if graph else "simulation",
                "bags": bags,
                "output": output,
                "plot": plot,
            }
        )
        return
    _tell(built, loops, path, settle, chosen)


def _stands(run: Tracking, output: str) -> bool:
    """Whether an axis that is told to move stays where it is."""
    import numpy as np

    column = run.names.index(output)
    moved, wanted = (float(np.ptp(one[:, column])) for one in (run.output, run.wanted))
    return moved < _STANDS * wanted


def _followed(controller: Controller) -> str:
    """Output that the controller makes follow the reference."""
    return str(controller.parameters.get("output") or controller.inputs[0])


def _ratio(after: float, before: float) -> float:
    return after / before if before > 0.0 else float("nan")


def _document(
    compensation: Compensation, controller: Controller, loops: Loops, reference: Reference, settle: float
) -> dict[str, Any]:
    """What was found, for JSON."""
    errors: dict[str, Any] = {}
    for name, unit in _rows(loops):
        before, after = loops.without.error_of(name, settle), loops.compensated.error_of(name, settle)
        errors[name] = {
            "unit": unit,
            "without": before,
            "with": after,
            "ratio": _ratio(after.rms, before.rms),
            "aim": None if loops.aim is None else loops.aim.error_of(name, settle),
        }
    assert controller.plan is not None  # noqa: S101 - it was built with a compensation
    return {
        "schema": SCHEMA,
        "model": compensation.model.name,
        "controller": compensation.model.controller,
        "followed": _followed(controller),
        "cancelled": {one.active.name: one.how for one in controller.plan.cancelled},
        "left": controller.plan.left,
        "settings": controller.settings,
        "reference": {"signal": reference.signal, "text": reference.words},
        "settle": settle,
        "errors": errors,
        "command": {
            "without": _size(loops.without.command),
            "with": _size(loops.compensated.command),
            "limit": controller.limit,
        },
    }


def _size(command: Any) -> Mapping[str, float]:
    """Root of the mean square and largest size of a command, and how much it changes from sample to sample."""
    import numpy as np

    return {
        "rms": float(np.sqrt(np.mean(command**2))),
        "largest": float(np.max(np.abs(command))),
        "step_rms": float(np.sqrt(np.mean(np.diff(command) ** 2))),
    }


def _rows(loops: Loops) -> list[tuple[str, str]]:
    """Name and unit of every output that has something to follow."""
    units = dict(zip(loops.without.names, loops.without.units, strict=True))
    return [(name, units[name]) for name in loops.without.followed]


def _tell(controller: Controller, loops: Loops, reference: Reference, settle: float, model: Model) -> None:
    """Print what is cancelled, and the errors without and with."""
    from idloop.control.compensation import WORDS

    assert controller.plan is not None  # noqa: S101 - it was built with a compensation
    told = [(one.active.name, WORDS[one.how]) for one in controller.plan.cancelled]
    told += [(name, f"not cancelled: {reason}") for name, reason in controller.plan.left.items()]
    if told:
        print_table(("effect", "cancelled by"), told)
    else:
        click.echo(f"model {model.name} has no effects: nothing is cancelled")
    click.echo(f"\nreference: {reference.words}\n")
    header = ["tracking error", "unit", "rms without", "rms with", "ratio", "largest without", "largest with"]
    table = []
    for name, unit in _rows(loops):
        before, after = loops.without.error_of(name, settle), loops.compensated.error_of(name, settle)
        row = [name, unit, *map(number, (before.rms, after.rms)), number(_ratio(after.rms, before.rms), 3)]
        row += map(number, (before.largest, after.largest))
        if loops.aim is not None:
            row.append(number(loops.aim.error_of(name, settle).rms))
        table.append(row)
    if loops.aim is not None:
        header.append("rms without the effects")
    print_table(header, table)
    for loop, run in (("without", loops.without), ("with", loops.compensated)):
        if _stands(run, _followed(controller)):
            click.echo(
                f"beware: {loop} compensation the axis does not move: the commands do not overcome what holds it"
            )
    sizes = [_size(run.command) for run in (loops.without, loops.compensated)]
    words = {"largest": "largest", "step_rms": "from sample to sample (rms)"}
    told_sizes = (
        f"{text} {number(sizes[0][key])} without, {number(sizes[1][key])} with" for key, text in words.items()
    )
    click.echo(f"\ncommand [{model.input.unit}]: {'; '.join(told_sizes)}")
