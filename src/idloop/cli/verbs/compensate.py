"""`idloop compensate`: what it gains to cancel the effects of a fitted model in the controller."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from idloop.cli._common import (
    MODEL,
    apply_options,
    json_option,
    log_written,
    model_options,
    open_model,
    plot_option,
    print_found,
    save_plot,
)
from idloop.cli._places import NEW_FOLDER, OUTPUT_FILE, force_option
from idloop.cli._progress import progress, quiet_option
from idloop.errors import InputError

if TYPE_CHECKING:
    from idloop.physics import Model

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
    no_noise: bool,
    graph: bool,
    bags: Path | None,
    domain: int | None,
    output: Path | None,
    force: bool,
    plot: Path | None,
    as_json: bool,
    **options: Any,
) -> None:
    """Follow a reference without and with compensation by MODEL, and say by how much the error falls.

    The controller cancels what it can of the effects that MODEL has: command effects by their inverse, forces along
    the reference, gaps when the reference turns round. The machine may be another one than MODEL says, which is the
    honest case: fit first, then compensate the machine that was fitted.
    """
    from idloop.api.compensation import compensate
    from idloop.api.tracking_runs import MJCF

    if bags is not None and not graph:
        raise InputError("--bags goes with --graph: a simulation records nothing")
    machine = None if plant is None else Path(plant) if plant.endswith(MJCF) else open_model(plant)
    options |= {"effects": only, "plant": machine, "plant_effects": plant_effect, "noise": not no_noise}
    chosen = apply_options(model, settings, effects)
    if graph:
        from idloop.cli._tracking_graph import run_loops

        found = compensate(chosen, run=partial(run_loops, bags=bags, domain=domain), **options)
    else:
        with progress("following the reference") as update:
            found = compensate(chosen, progress=update, **options)
    if output is not None:
        found.save(output)
    log_written(output)
    save_plot(found.plot, plot)
    log_written(plot)
    run = "graph" if graph else "simulation"
    print_found(
        found, as_json=as_json, plant=plant, plant_effects=plant_effect, run=run, bags=bags, output=output, plot=plot
    )
