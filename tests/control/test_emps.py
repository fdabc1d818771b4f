"""The cascade against the recorded command of a real drive."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.io import loadmat

from idloop.control import build_controller


def test_cascade_reproduces_the_recorded_command(data_dir):
    path = data_dir / "emps" / "DATA_EMPS.mat"
    if not path.is_file():
        pytest.skip(f"no {path.name} in {path.parent}: fetch the EMPS benchmark")
    record = loadmat(path)
    reference, measured, command = (record[key].ravel() for key in ("qg", "qm", "vir"))
    controller = build_controller(
        {
            "type": "cascade",
            "output": "load.position",
            "kp": 160.18,
            "kv": 243.45,
            "velocity_estimate": "mean",
            "limit": 10.0,
            "sample_time": 0.001,
        }
    )
    got = np.array([controller.step(r, 0.0, [y]) for r, y in zip(reference, measured, strict=True)])
    # The law needs two positions from before the record: its first two samples cannot be known.
    error = np.linalg.norm((got - command)[2:]) / np.linalg.norm(command[2:])
    assert error < 0.003
    assert not controller.saturated
