"""A closed loop without and with compensation: the reference, the machine, and the runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from idloop.api.data import read_bag
from idloop.arrays import Array
from idloop.control import build_controller
from idloop.control.controller_file import load_controller
from idloop.control.tracking import track
from idloop.errors import InputError
from idloop.parameter_table import read_mapping
from idloop.physics import Plant, preset_names
from idloop.signals import build_signal

if TYPE_CHECKING:
    from idloop.control.compensation import Compensation
    from idloop.control.tracking import Tracking
    from idloop.physics import Machine, Model

MJCF = ".xml"
# The reference when none is given: to and fro, at rest between, in the unit of the reference.
DEFAULT_REFERENCE: dict[str, Any] = {
    "name": "smooth",
    "points": [1.0, -1.0],
    "amplitude": 1.0,
    "velocity_limit": 1.0,
    "acceleration_limit": 10.0,
    "dwell": 0.5,
    "duration": 20.0,
}
# Share of the controller's limit that the default reference may ask for.
ASKED = 0.5


@dataclass(frozen=True)
class Reference:
    """What is followed.

    Attributes
    ----------
    path : ndarray (n, 2)
        Position and velocity at every period of the controller.
    signal : dict or None
        The signal with its parameters; None where it was recorded.
    words : str
        What it is.
    """

    path: Array
    signal: Mapping[str, Any] | None
    words: str


def controller_section(model: Model, text: str | None) -> dict[str, Any]:
    """Section of the controller: that of ``--controller``, else the model's.

    Raises
    ------
    InputError
        There is none, or the text is neither a file with a controller nor a YAML mapping.
    """
    if text is None:
        section = model.controller
    elif text in preset_names() or Path(text).is_file():
        section = load_controller(text)
    else:
        section = read_mapping(text, "--controller", "{type: pid, kp: 1.0, ...}, or a file")
    if section is None:
        raise InputError(f"model {model.name} names no controller: add one to its file, or give --controller")
    return {"sample_time": 0.001, **section}


def make_reference(text: str | None, model: Model, section: Mapping[str, Any]) -> Reference:
    """Build or read the reference.

    `text`: a signal as YAML, a bag whose reference is followed again, or None for moves to and fro within half of the
    controller's limit.
    `section`: of the controller.
    """
    if text is None:
        return _within_limit(model, section)
    if not text.lstrip().startswith("{"):
        return _recorded(Path(text), model, float(section["sample_time"]))
    return built(read_mapping(text, "--reference", "{name: sine, frequency: 0.2, amplitude: 1.0}"), section)


def built(signal: Mapping[str, Any], section: Mapping[str, Any]) -> Reference:
    """Reference of a signal, as the excitation node publishes it."""
    given = dict(signal)
    name = given.pop("name", None)
    if not isinstance(name, str):
        raise InputError("--reference: name is missing; for example {name: sine, frequency: 0.2, amplitude: 1.0}")
    period = float(section["sample_time"])
    given = {"duration": 20.0, "amplitude": 1.0, **given}
    made = build_signal(name, **{**given, "sample_time": period})
    rate = np.zeros_like(made.value) if made.rate is None else made.rate
    words = ", ".join(f"{key} {value}" for key, value in given.items())
    return Reference(np.column_stack([made.value, rate]), {"name": name, **given}, f"{name} ({words})")


def _recorded(bag: Path, model: Model, period: float) -> Reference:
    record = read_bag(bag, model)
    if record.reference is None or record.reference_time is None:
        raise InputError(f"{bag}: holds no reference: give a signal instead, as in {{name: sine, frequency: 0.2}}")
    time = np.arange(record.time[0], record.time[-1], period)
    place = np.searchsorted(record.reference_time, time + 1e-9, side="right") - 1
    held = np.nan_to_num(record.reference[np.maximum(place, 0)])
    return Reference(held, None, f"as recorded in {bag}")


def _within_limit(model: Model, section: Mapping[str, Any]) -> Reference:
    """Default reference, made smaller where the linear part of the model would need more than half of the limit."""
    first = built(DEFAULT_REFERENCE, section)
    controller = build_controller({**section, "limit": None})
    limit = build_controller(section).limit
    linear = model.without_effects(model.effect_names)
    most = float(np.max(np.abs(track(Plant(linear, noise=False), controller, first.path).command)))
    if not most > ASKED * limit:
        return first
    size = float(f"{ASKED * limit / most:.2g}")
    sized = {key: size * DEFAULT_REFERENCE[key] for key in ("amplitude", "velocity_limit", "acceleration_limit")}
    return built({**DEFAULT_REFERENCE, **sized}, section)


def machine_of(source: Model | Path | None, effects: Sequence[str], model: Model) -> Model | Path:
    """The machine: a model, or an MJCF file that MuJoCo moves.

    `source`: model, or path of an MJCF file; None: the compensating model itself.
    `effects`: added to it.
    `model`: the compensating model.
    """
    if isinstance(source, Path):
        if effects:
            raise InputError("--plant-effect: an MJCF file has effects of its own; change the file")
        return source
    machine = (model if source is None else source).with_effects(list(effects))
    if machine.output_names != model.output_names:
        raise InputError(
            f"--plant {machine.name}: measures {', '.join(machine.output_names)}, but model {model.name} "
            f"{', '.join(model.output_names)}: they must be the same"
        )
    return machine


@dataclass(frozen=True)
class Loops:
    """The loop without and with compensation."""

    without: Tracking
    compensated: Tracking
    # Without compensation, on the model without what is cancelled: what no compensation can better
    aim: Tracking | None = None


def simulate_loops(
    machine: Model | Path,
    compensation: Compensation,
    section: Mapping[str, Any],
    reference: Reference,
    *,
    seed: int,
    noise: bool,
    progress: Callable[[float, str], object],
) -> Loops:
    """Run a simulated machine without and with compensation, and the model without what is cancelled.

    `machine`: from `machine_of`.
    `section`: of the controller.
    `seed`: of the measurement noise, the same in every run.
    `progress`: receives the share done and what is done.
    """
    period = float(section["sample_time"])
    compensated = build_controller(section, compensation=compensation)
    assert compensated.plan is not None  # noqa: S101 - it was given a compensation
    rest = compensation.model.without_effects(one.active.name for one in compensated.plan.cancelled)
    runs = []
    plain = build_controller(section)
    several = (("without", plain, machine), ("with", compensated, machine), ("without the effects", plain, rest))
    for number, (what, controller, plant) in enumerate(several):

        def update(share: float, number: int = number, what: str = what) -> None:
            progress((number + share) / 3.0, what)

        runs.append(track(_build(plant, compensation.model, period, seed, noise), controller, reference.path, update))
    return Loops(*runs)


def _build(machine: Model | Path, model: Model, period: float, seed: int, noise: bool) -> Machine:
    if isinstance(machine, Path):
        from idloop.physics.mjcf_plant import MjcfPlant

        return MjcfPlant(machine, model, period, seed=seed, noise=noise)
    return Plant(machine, seed=seed, noise=noise)
