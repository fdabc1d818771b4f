"""Replay of a recording into a live estimator, with the graph `replay`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from idloop.errors import IdloopError, InputError
from idloop.graph.description import load_graph
from idloop.graph.live_results import LiveResult, read_results
from idloop.graph.processes import Say, run_graph
from idloop.physics import load_model


@dataclass(frozen=True)
class Windows:
    """Windows of the data of a live estimator."""

    # Length of the data of a fit, of the validation data after it, and time between fits [s]
    window: float = 20.0
    validation: float = 10.0
    period: float = 10.0


def replay_bag(
    bag: Path,
    model: str,
    target: Path,
    *,
    effects: Sequence[str] = (),
    windows: Windows | None = None,
    rate: float = 0.0,
    say: Say | None = None,
    domain_id: int | None = None,
) -> LiveResult:
    """Play a bag into a graph of estimator and recorder.

    `model`: preset or model file of the estimator; `target`: new bag with its results; `effects`: added to the model;
    `rate`: relative to real time, 0: as fast as the nodes acknowledge; `say`, `domain_id`: as in `run_graph`. Raises
    InputError: the bag is too short for the windows; IdloopError: stopped before the end, or without a fit.
    """
    from idloop.records import read_record

    windows = windows or Windows()
    # Rounded to four digits, as a user would set it.
    record = read_record(bag, load_model(model))
    period = float(f"{record.sample_time:.4g}")
    needed = windows.window + windows.validation
    if record.duration + period < needed:
        raise InputError(
            f"{bag}: {record.duration:.4g} s are too short for a fit on {windows.window:g} s and validation on "
            f"{windows.validation:g} s: shorten --window and --validation"
        )
    values = {
        "play": str(bag.absolute()),
        "model": model,
        "effects": repr(list(effects) or [""]),
        "sample_time": repr(period),
        "window": repr(windows.window),
        "validation": repr(windows.validation),
        "fit_period": repr(windows.period),
        "rate": repr(rate),
        "bag": str(target),
    }
    if not run_graph(load_graph("replay", values), say=say, domain_id=domain_id):
        raise IdloopError("stopped before the end of the bag")
    result = read_results(target)
    if not result.fits or result.error:
        raise IdloopError(result.error or "the estimator made no fit")
    return result
