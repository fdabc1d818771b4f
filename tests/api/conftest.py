"""Logs that several tests of the API begin with."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest


@pytest.fixture
def set_point_log(tmp_path: Path) -> Callable[[float, str], Path]:
    """Return a function that writes the log of a position which follows steps of a set-point up to a size."""

    def write(size: float, unit: str) -> Path:
        time = np.arange(1500) / 100.0
        wanted = np.repeat(np.random.default_rng(1).uniform(-size, size, size=15), 100)
        angle, place = np.empty(1500), 0.0
        for k, target in enumerate(wanted):
            angle[k] = place
            place += 0.3 * (target - place)
        rows = "\n".join(f"{t:.2f},{u:.4f},{q:.5f}" for t, u, q in zip(time, wanted, angle, strict=True))
        path = tmp_path / "log.csv"
        path.write_text(f"t_s,servo_cmd,angle_{unit}\n{rows}\n")
        return path

    return write
