"""Free run by idloop's compiled simulator."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from speed.plants import PLANTS

from idloop.physics import simulate


def work(data: dict[str, Any], settings: dict[str, Any]) -> Callable[[], dict[str, Any]]:
    """Positions at each sample."""
    model = next(plant for plant in PLANTS if plant.name == settings["plant"]).model()
    stamps = np.arange(len(data["command"])) * settings["period"]
    body = [k for k, output in enumerate(model.outputs) if output.field == "position"]
    return lambda: {"position": simulate(model, stamps, data["command"], stamps).output[:, body]}
