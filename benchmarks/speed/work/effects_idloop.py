"""Free run of the DC motor with some effects, by idloop."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from idloop.physics import load_model, simulate


def work(data: dict[str, Any], settings: dict[str, Any]) -> Callable[[], dict[str, Any]]:
    """Outputs at each sample."""
    model = load_model("dc_motor").with_effects(settings["effects"])
    stamps = np.arange(len(data["command"])) * settings["period"]
    return lambda: {"output": simulate(model, stamps, data["command"], stamps).output}
