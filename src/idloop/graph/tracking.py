"""Tracking experiments on the live graph, with or without compensation, read back from the bag."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from idloop.documents import read_text, read_yaml
from idloop.errors import IdloopError
from idloop.graph.description import load_graph
from idloop.graph.processes import Say, run_graph

if TYPE_CHECKING:
    from idloop.control.compensation import Compensation
    from idloop.control.tracking import Tracking
    from idloop.physics import Model

GRAPH = "track"
# Parameters of the excitation node common to all kinds of signals; others have the prefix of their kind.
_COMMON = frozenset({"amplitude", "offset", "seed", "ramp_in"})


@dataclass(frozen=True)
class TrackingExperiment:
    """A tracking experiment on the graph."""

    model: Model  # model with the input, outputs and controller of the nodes
    machine: Model | Path  # the simulated machine, or an MJCF file that MuJoCo simulates
    signal: Mapping[str, Any]  # the reference: ``name``, ``duration`` [s] and the signal's own parameters
    seed: int = 0  # of the measurement noise
    noise: bool = True  # whether to add measurement noise


def track_on_graph(
    experiment: TrackingExperiment,
    compensation: Compensation | None,
    bag: Path,
    scratch: Path,
    *,
    say: Say | None = None,
    domain_id: int | None = None,
) -> Tracking:
    """Run excitation, controller, machine and recorder to the end of the signal.

    `compensation`: compensation of the controller node; None: none. `bag`: recording to make. `scratch`: folder for the
    input files of the nodes. `say`, `domain_id`: as in `run_graph`. Returns: the measured run. Raises IdloopError: a
    node failed, or the run was stopped before its end.
    """
    values = launch_values(experiment, compensation, bag, scratch)
    if not run_graph(load_graph(GRAPH, values), say=say, domain_id=domain_id):
        raise IdloopError("stopped before the end of the reference")
    return read_tracking(bag, experiment.model)


def launch_values(
    experiment: TrackingExperiment, compensation: Compensation | None, bag: Path, scratch: Path
) -> dict[str, str]:
    """Write the files that the nodes read, and return the arguments of the launch file."""
    import yaml

    model, machine = experiment.model, experiment.machine
    section = dict(model.controller or {})
    values = {
        "model": str(_save(model, scratch / "model")),
        "controller": yaml.safe_dump(section, default_flow_style=True, width=10**6).strip(),
        "joint": model.input.joint,
        "sample_time": repr(float(section["sample_time"])),
        "duration": repr(float(experiment.signal["duration"])),
        "seed": str(experiment.seed),
        "noise": str(experiment.noise).lower(),
        "bag": str(bag.absolute()),
        "config": str(_write_config(experiment.signal, compensation, scratch / "track.yaml")),
    }
    if isinstance(machine, Path):
        values |= {"mujoco": "true", "mjcf": str(machine.absolute())}
    else:
        values["machine"] = str(_save(machine, scratch / "machine"))
    if compensation is not None:
        values |= {
            "compensation": str(_save(compensation.model, scratch / "compensation")),
            "compensation_effects": repr(list(compensation.effects) or [""]),
        }
    return values


def _save(model: Model, folder: Path) -> Path:
    """Model file in its own folder, with a link to the user's effects, which are trusted by their folder."""
    folder.mkdir(exist_ok=True)
    for effects in model.effect_folders:
        link = folder / "effects"
        if effects.is_dir() and not link.exists():
            link.symlink_to(effects.resolve(), target_is_directory=True)
    path = folder / "model.yaml"
    model.save(path)
    return path


def _write_config(signal: Mapping[str, Any], compensation: Compensation | None, path: Path) -> Path:
    """Parameter file of the graph with this signal and the settings of the compensation."""
    import yaml

    file = load_graph(GRAPH).nodes[0].parameter_files[0]
    config = read_yaml(read_text(file), str(file))
    name = signal["name"]
    excitation = config["excitation"]["ros__parameters"]
    # Parameters that are not given have the default of the signal, not that of the graph.
    for key in [one for one in excitation if "." in one]:
        del excitation[key]
    excitation["signal"] = name
    for key, value in signal.items():
        if key not in ("name", "duration", "sample_time"):
            excitation[key if key in _COMMON else f"{name}.{key}"] = _plain(value)
    if compensation is not None:
        controller = config["controller"]["ros__parameters"]
        for key in ("limit", "velocity_width", "command_width", "crossing_time"):
            number = getattr(compensation, key)
            if number is not None:
                controller[f"compensation_{key}"] = float(number)
    path.write_text(yaml.safe_dump(config, sort_keys=False), encoding="utf-8")
    return path


def _plain(value: Any) -> Any:
    """Value for a parameter file: the numbers of a list are all floats or all integers."""
    if isinstance(value, list | tuple) and any(isinstance(item, float) for item in value):
        return [float(item) for item in value]
    return list(value) if isinstance(value, tuple) else value


def read_tracking(bag: Path, model: Model) -> Tracking:
    """Tracking of a recorded run.

    `bag`: one run with a recorded reference; `model`: model with the controller of the run. Raises InputError: the bag
    cannot be read; IdloopError: it has no reference.
    """
    from idloop.control import check_controller
    from idloop.control.tracking import Tracking, wanted_outputs
    from idloop.records import read_record

    record = read_record(bag, model)
    if record.reference is None or record.reference_time is None:
        raise IdloopError(f"{bag}: no reference was recorded")
    # Stamps are integer nanoseconds; half of one is tolerance.
    place = np.searchsorted(record.reference_time, record.time + 5e-10, side="right") - 1
    reference = np.nan_to_num(record.reference[np.maximum(place, 0)])
    sent = np.searchsorted(record.input_time, record.time + 5e-10, side="right") - 1
    return Tracking(
        record.time - record.time[0],
        record.output,
        wanted_outputs(model, check_controller(model.controller), reference),
        record.input[np.maximum(sent, 0)],
        record.output_names,
        record.output_units,
    )
