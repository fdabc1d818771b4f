"""Recordings of the papers' machines by the simulators of this suite, for the rows in `papers`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from laws import law
from simulators import machine, run

from papers.hidden_effects import Recording, Simulate, to_record, white_noise


def simulated_by(simulator: str) -> Simulate:
    """How a row gets its recordings.

    Parameters
    ----------
    simulator : str
        One of `simulators.SIMULATORS`.

    Returns
    -------
    callable
        From model, recording and seed to a record.
    """

    def simulate(model: Any, recording: Recording, seed: int) -> Any:
        count = len(recording.signal)
        built = machine(simulator, model, 1.0 / recording.rate, count)
        behind = law(simulator, model.controller, model.output_names)
        noise = white_noise(model, count, seed)
        command, output = run(built, recording.signal, recording.speed, noise, recording.torque, behind)
        return to_record(model, recording, command, output)

    return simulate


def plain_numbers(value: Any) -> Any:
    """The same document with None for what is no number, as JSON needs it."""
    if isinstance(value, Mapping):
        return {str(k): plain_numbers(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [plain_numbers(v) for v in value]
    if isinstance(value, float | np.floating):
        return float(value) if math.isfinite(value) else None
    return value
