"""Grey-box fit by idloop: free-run errors, exact slopes along the motion."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from speed.motor import PERIOD, START, motor

from idloop.estimation.greybox import fit
from idloop.records import Record


def work(data: dict[str, Any], settings: dict[str, Any]) -> Callable[[], dict[str, Any]]:
    """The named parameters from the start that all contestants have."""
    model = motor(START, tuple(settings["names"]))
    stamps = np.arange(len(data["command"])) * PERIOD
    names = model.input.name, model.input.unit, model.output_names, tuple(output.unit for output in model.outputs)
    record = Record("motor", stamps, data["command"], stamps, data["output"], *names)

    def act() -> dict[str, Any]:
        values = fit(model, [record], "simulation").model.values
        found = {"gain": values["drive.gain"], "viscous": values["motor.viscous_friction"]}
        for key, value in values.items():
            if "stribeck" in key:
                found[key.rpartition(".")[2]] = value
        return found

    return act
