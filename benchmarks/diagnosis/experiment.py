"""From a case to what the diagnosis gets: a start model that tells nothing, and records."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from by_drive import DriveMachine
from case import Case, Drive
from disturbances import disturbance, measurement_noise
from drives import BEFORE_ROUNDING, READING
from excitations import EXCITATIONS
from laws import law
from machines import MACHINES, base_model
from nuisances import stamps, ticks
from numpy.typing import NDArray
from plain import plain
from simulators import Machine, machine, run
from sizes import sizes

from papers.hidden_effects import told_nothing

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Experiment:
    """Data of one case.

    Attributes
    ----------
    truth : Model
        The machine as it is, quantisation included.
    start : Model
        Its linear part, free parameters moved, nothing hidden in it.
    training, validation : tuple of Record
    """

    truth: Any
    start: Any
    training: tuple[Any, ...]
    validation: tuple[Any, ...]


def true_model(case: Case) -> Any:
    """The machine with everything it hides."""
    model = base_model(case.machine, case.rate, case.loop)
    model = replace(model, outputs=tuple(replace(o, noise=case.noise.factor * o.noise) for o in model.outputs))
    for item in case.hidden:
        model = model.with_effect(item.effect, item.at, **item.values)
    for site, resolution in case.quantisation.items():
        model = model.with_entry("sensor_quantisation", site, {"resolution": resolution})
    return model


def start_model(case: Case, suite: int) -> Any:
    """The model that the diagnosis starts from."""
    model = base_model(case.machine, case.rate, case.loop)
    told = case.noise.factor if case.noise.told else None
    outputs = tuple(replace(o, noise=told * o.noise if told is not None else None) for o in model.outputs)
    model = replace(model, outputs=outputs)
    known = [item.at for item in case.hidden if item.effect == "viscous_friction"]
    if known:
        # a hidden drag can only be told from the model's own when that one is known
        model = model.with_free([name for name in model.free if name.removesuffix(".viscous_friction") not in known])
    return told_nothing(model, case.seed(suite, "start"))


def record(case: Case, drive: Drive, suite: int, what: str) -> Any:
    """Simulate one recording."""
    return record_of(case, true_model(case), *sent(case, drive, suite, what), suite, what)


def sent(case: Case, drive: Drive, suite: int, what: str) -> tuple[Array, Array | None]:
    """Samples of the command or the reference, and their velocity where it is known."""
    kind = MACHINES[case.machine]
    return EXCITATIONS[drive.kind](kind, drive.level, case.rate, case.duration, case.seed(suite, what))


def record_of(case: Case, truth: Any, signal: Array, speed: Array | None, suite: int, what: str) -> Any:
    """Simulate a recording of given samples of the command (open loop) or the reference (closed loop)."""
    return simulated(case, truth, signal, speed, suite, what)[0]


def simulated(
    case: Case, truth: Any, signal: Array, speed: Array | None, suite: int, what: str
) -> tuple[Any, Machine, Array]:
    """As `record_of`, with the machine that was run and the times at which its samples were taken."""
    from idloop.records import record_from_model

    count = len(signal)
    usual = sizes(case.machine, case.loop, case.training[0])
    torque = disturbance(
        case.disturbance.kind, case.disturbance.share * usual.force, count, case.seed(suite, f"{what}/torque")
    )
    std = np.array([o.noise for o in truth.outputs], dtype=float)
    noise = measurement_noise(case.noise.kind, std, count, case.seed(suite, f"{what}/noise"))
    taken = time = np.asarray(np.arange(count) / case.rate)
    if case.nuisances is None:
        built = machine(case.simulator, truth, 1.0 / case.rate, count)
    else:
        taken = ticks(case.nuisances, case.rate, count, case.seed(suite, f"{what}/ticks"))
        time = stamps(case.nuisances, taken[:-1], case.rate, case.seed(suite, f"{what}/stamps"))
        built = DriveMachine(plain(truth), case.nuisances, taken, case.rate)
        # what lies before the rounding, which is the encoder's own
        noise *= BEFORE_ROUNDING / READING
    behind = law(case.simulator, truth.controller, truth.output_names)
    command, output = run(built, signal, speed, noise, torque, behind)
    reference = None
    if case.loop == "closed":
        reference = np.column_stack([signal, np.full(count, np.nan) if speed is None else speed])
    return record_from_model(f"{case.id} {what}", truth, time, command, output, reference), built, taken


def experiment(case: Case, suite: int = 1) -> Experiment:
    """Simulate all recordings of a case.

    Parameters
    ----------
    case : Case
    suite : int
        Seed of the whole suite.
    """
    training = tuple(record(case, drive, suite, f"training{i}") for i, drive in enumerate(case.training))
    validation = (record(case, case.validation, suite, "validation"),)
    return Experiment(true_model(case), start_model(case, suite), training, validation)
