"""The source papers redone: each row of their results beside ours, by one function.

``reproduce("A3")`` runs a row; ``ROWS`` lists them. To add a row, write a file with a function
``(seed, progress) -> Reproduction`` and enter it below.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple

from idloop.errors import InputError
from idloop.spelling import did_you_mean_or_known

if TYPE_CHECKING:
    from papers.reproduction import Reproduction

Progress = Callable[[float, str], None]

LEHIGH = "Rungroungdouyboon, Lehigh University 1999"
LINKOPING = "Myklebust, Linköping University 2009"
STAGE = "Shamseldin, WSEAS 2022"


class Row(NamedTuple):
    """Title of a row, its paper, its function as ``module:function`` of this package, and parts that run alone."""

    title: str
    paper: str
    place: str
    parts: tuple[str, ...] = ()


ROWS: dict[str, Row] = {
    "A1": Row("The DC motor as a model", LEHIGH, "motor.dc_motor_plant:reproduce"),
    "A2": Row("Signals and channels recorded together", LEHIGH, "motor.signal_generator:reproduce"),
    "A3": Row("Grey-box fit with standard deviations, loss and FPE", LEHIGH, "motor.dc_motor_grey_box:reproduce"),
    "A4": Row("The toolbox's layers on one data set", LEHIGH, "motor.toolbox_layers:reproduce"),
    "A5": Row("Linear fits of a motor with dead zone and backlash", LEHIGH, "motor.dead_zone_and_backlash:reproduce"),
    "A6": Row(
        "Drifting linear fits, and the effects that explain them",
        LEHIGH,
        "motor.drifting_fits:reproduce",
        ("dead-zone", "dead-zone+friction"),
    ),
    "A7": Row("Describing functions and limit cycles", LEHIGH, "motor.describing_functions:reproduce"),
    "A8": Row("Response of the closed loop", LEHIGH, "motor.closed_loop_response:reproduce"),
    "B1": Row("The torsion plant and a misprint in it", LINKOPING, "torsion.torsion_plant:reproduce"),
    "B2": Row(
        "Effects of the torsion system, hidden and found",
        LINKOPING,
        "torsion.torsion_effects:reproduce",
        (
            "offset",
            "friction",
            "imbalance",
            "slip",
            "saturation",
            "friction+imbalance",
            "offset+friction+imbalance",
            "all",
        ),
    ),
    "B3": Row("PID and PD controllers and their limit", LINKOPING, "torsion.torsion_controller:reproduce"),
    "B4": Row("PRBS and Gaussian references, down-sampled", LINKOPING, "torsion.torsion_excitation:reproduce"),
    "B5": Row("The offset of the input compensated, or not", LINKOPING, "torsion.torsion_compensation:reproduce"),
    "B6": Row("Seven ways to identify, verified in simulation", LINKOPING, "torsion.torsion_verification:reproduce"),
    "B7": Row("FIT per output and averaged", LINKOPING, "torsion.torsion_fit_measure:reproduce"),
    "B8": Row("Sweeps of excitation, sample time, states, horizon", LINKOPING, "torsion.torsion_sweeps:reproduce"),
    "B9": Row("One model for two amplitudes, and for a third", LINKOPING, "torsion.torsion_amplitudes:reproduce"),
    "C1": Row("The lead-screw stage and its PRBS experiment", STAGE, "stage.stage_machine:reproduce"),
    "C2": Row("Linear transfer function of the stage", STAGE, "stage.stage_linear:reproduce"),
    "C3": Row("Wavelet network of the stage", STAGE, "stage.stage_wavelet:reproduce"),
    "C4": Row("Neural network of the stage", STAGE, "stage.stage_neural:reproduce"),
    "C5": Row("All candidates of the stage, and a grey-box model", STAGE, "stage.stage_comparison:reproduce"),
}


def find_row(name: str) -> str:
    """Name of a row as the table has it, whatever its case.

    Raises
    ------
    InputError
        There is no such row.
    """
    known = {row.casefold(): row for row in ROWS}
    if name.casefold() not in known:
        raise InputError(f"no row '{name}' of the papers{did_you_mean_or_known(name, list(ROWS))}")
    return known[name.casefold()]


def find_parts(name: str, parts: Sequence[str]) -> tuple[str, ...]:
    """Parts of a row, once each.

    Raises
    ------
    InputError
        The row has no such part.
    """
    known = ROWS[find_row(name)].parts
    for part in parts:
        if not known:
            raise InputError(f"row {find_row(name)} has no parts; leave '{part}' out")
        if part not in known:
            raise InputError(f"row {find_row(name)} has no part '{part}'{did_you_mean_or_known(part, list(known))}")
    return tuple(dict.fromkeys(parts))


def reproduce(name: str, seed: int = 0, progress: Progress | None = None, parts: Sequence[str] = ()) -> Reproduction:
    """Redo a row of a paper.

    Parameters
    ----------
    name : str
        One of `ROWS`.
    seed : int
        Of the measurement noise; equal seeds give equal results.
    progress : callable, optional
        Called with the share done in [0, 1] and a short text.
    parts : sequence of str
        Of a row that has parts: which of them; the row's own choice when empty.

    Raises
    ------
    InputError
        There is no such row or part, or the seed is negative.
    """
    row, chosen = ROWS[find_row(name)], find_parts(name, parts)
    if seed < 0:
        raise InputError(f"seed {seed}: give 0 or a whole number above it")
    module, _, function = row.place.partition(":")
    run = getattr(importlib.import_module(f"{__name__}.{module}"), function)
    choice = {"parts": chosen} if chosen else {}
    found: Reproduction = run(seed, progress or (lambda share, text: None), **choice)
    return found
