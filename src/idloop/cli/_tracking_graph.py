"""`idloop compensate --graph`: the nodes once without and once with compensation, compared by their bags."""

from __future__ import annotations

import contextlib
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from idloop.api.tracking_runs import Loops, Reference
from idloop.cli._common import log
from idloop.cli._demo_loop import narrated
from idloop.errors import InputError
from idloop.output_files import make_folder

if TYPE_CHECKING:
    from idloop.control.compensation import Compensation
    from idloop.physics import Model

# About how long a run takes, for the bar [s].
_LONG = 30.0
RUNS = ("without", "with")


def run_loops(
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
    """Run the graph twice.

    `machine`: from `idloop.api.tracking_runs.machine_of`. `section`: of the controller, which the compensating model
    names. `bags`: new folder for the recordings; None: they are not kept. `domain`: ROS domain of these graphs alone.
    `seed`, `noise`: of the sensors. Raises InputError: the reference is no signal that the excitation node can play.
    """
    from idloop.graph.tracking import TrackingExperiment, track_on_graph

    if reference.signal is None:
        raise InputError("--reference: on the graph the reference must be a signal, not a bag")
    experiment = TrackingExperiment(compensation.model, machine, reference.signal, seed, noise)
    found = []
    with _folder(bags) as folder, tempfile.TemporaryDirectory(prefix="idloop_compensate_") as scratch:
        for name, used in zip(RUNS, (None, compensation), strict=True):
            with narrated(f"graph {name} compensation", _LONG) as say:
                run = track_on_graph(experiment, used, folder / name, Path(scratch), say=say, domain_id=domain)
            found.append(run)
    if bags is not None:
        log(f"written: {', '.join(str(bags / name) for name in RUNS)}")
    return Loops(*found)


@contextlib.contextmanager
def _folder(bags: Path | None) -> Iterator[Path]:
    if bags is not None:
        make_folder(bags, parents=True)
        yield bags
        return
    with tempfile.TemporaryDirectory(prefix="idloop_bags_") as scratch:
        yield Path(scratch)
