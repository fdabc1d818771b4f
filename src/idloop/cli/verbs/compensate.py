"""`idloop compensate`: what it gains to cancel the effects of a fitted model in the controller."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from idloop.cli import _inputs, _outputs
from idloop.cli._progress import progress
from idloop.errors import InputError
from idloop.output_files import make_folder

if TYPE_CHECKING:
    from idloop.api.tracking_runs import Loops, Reference
    from idloop.control.compensation import Compensation
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
_LONG = 30.0  # about how long a run of the graph takes, for the bar [s]
RUNS = ("without", "with")


@click.command(epilog=EXAMPLE)
@_inputs.model_argument
@_inputs.model_options
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
@click.option("--limit", type=_inputs.POSITIVE, help="Most that is added to the command; left out, half of its limit.")
@click.option("--velocity-width", type=_inputs.POSITIVE, help="Speed below which dry friction is cancelled in part.")
@click.option("--command-width", type=_inputs.POSITIVE, help="Command below which a dead zone is crossed in part.")
@click.option("--crossing-time", type=_inputs.POSITIVE, help="Time in which a gap is crossed, in seconds.")
@_inputs.option(
    "--settle", type=click.FloatRange(min=0.0), default=1.0, help="Seconds at the beginning that do not count."
)
@_inputs.option("--seed", type=click.IntRange(min=0), default=0, help="Of the measurement noise.")
@click.option("--no-noise", is_flag=True, help="Sensors without noise.")
@click.option("--graph", is_flag=True, help="Run the nodes, once without and once with, and read their bags.")
@click.option("--bags", type=_outputs.NEW_FOLDER, metavar="FOLDER", help="Keep the bags of --graph in a new folder.")
@_inputs.domain_option
@_outputs.output_option("FILE", "Write the compensator for the controller node.")
@_outputs.drawn_work_options
def command(
    model: Model,
    *,
    only: tuple[str, ...],
    plant: str | None,
    plant_effect: tuple[str, ...],
    no_noise: bool,
    graph: bool,
    bags: Path | None,
    domain: int | None,
    output: Path | None,
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
    machine = None if plant is None else Path(plant) if plant.endswith(MJCF) else _inputs.open_model(plant)
    options |= {"effects": only, "plant": machine, "plant_effects": plant_effect, "noise": not no_noise}
    chosen = _inputs.with_options(model)
    if graph:
        found = compensate(chosen, run=partial(run_graph_twice, bags=bags, domain=domain), **options)
    else:
        with progress("following the reference") as update:
            found = compensate(chosen, progress=update, **options)
    more = {"plant": plant, "plant_effects": plant_effect, "run": "graph" if graph else "simulation", "bags": bags}
    _outputs.deliver(found, as_json=as_json, output=output, plot=plot, **more)


def run_graph_twice(
    machine: Model | Path,
    compensation: Compensation,
    section: Mapping[str, Any],
    reference: Reference,
    *,
    bags: Path | None,
    domain: int | None,
    seed: int,
    noise: bool,
) -> Loops:
    """Run the nodes without and with compensation, in the place of `idloop.api.tracking_runs.simulate_loops`.

    `bags`: new folder for the recordings, which are not kept without one. `domain`: ROS domain of these graphs alone.
    Raises InputError: the reference is no signal that the excitation node can play.
    """
    del section  # the compensating model names its controller
    from idloop.api.tracking_runs import Loops
    from idloop.cli._demo_loop import narrated
    from idloop.graph.tracking import TrackingExperiment, track_on_graph

    if reference.signal is None:
        raise InputError("--reference: on the graph the reference must be a signal, not a bag")
    experiment = TrackingExperiment(compensation.model, machine, reference.signal, seed, noise)
    found = []
    with tempfile.TemporaryDirectory(prefix="idloop_compensate_") as scratch:
        folder = Path(scratch) / "bags" if bags is None else bags
        make_folder(folder, parents=True)
        for name, used in zip(RUNS, (None, compensation), strict=True):
            with narrated(f"graph {name} compensation", _LONG) as say:
                found.append(track_on_graph(experiment, used, folder / name, Path(scratch), say=say, domain_id=domain))
    if bags is not None:
        _outputs.log(f"written: {', '.join(str(bags / name) for name in RUNS)}")
    return Loops(*found)
