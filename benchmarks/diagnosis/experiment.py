"""From a case to what the diagnosis gets: a start model that tells nothing, and records."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from case import Case, Drive
from disturbances import disturbance, measurement_noise
from excitations import EXCITATIONS
from laws import law
from machines import MACHINES, base_model
from numpy.typing import NDArray
from simulators import machine, run
from sizes import sizes

from idloop.papers.hidden_effects import told_nothing

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
    kind = MACHINES[case.machine]
    truth = true_model(case)
    signal, speed = EXCITATIONS[drive.kind](kind, drive.level, case.rate, case.duration, case.seed(suite, what))
    return record_of(case, truth, signal, speed, suite, what)


def record_of(case: Case, truth: Any, signal: Array, speed: Array | None, suite: int, what: str) -> Any:
    """Simulate a recording of given samples of the command (open loop) or the reference (closed loop)."""
    from idloop.records import record_from_model

    count = len(signal)
    usual = sizes(case.machine, case.loop, case.training[0])
    torque = disturbance(
        case.disturbance.kind, case.disturbance.share * usual.force, count, case.seed(suite, f"{what}/torque")
    )
    std = np.array([o.noise for o in truth.outputs], dtype=float)
    noise = measurement_noise(case.noise.kind, std, count, case.seed(suite, f"{what}/noise"))
    built = machine(case.simulator, truth, 1.0 / case.rate, count)
    behind = law(case.simulator, truth.controller, truth.output_names)
    command, output = run(built, signal, speed, noise, torque, behind)
    time = np.asarray(np.arange(count) / case.rate)
    reference = None
    if case.loop == "closed":
        reference = np.column_stack([signal, np.full(count, np.nan) if speed is None else speed])
    return record_from_model(f"{case.id} {what}", truth, time, command, output, reference)


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
