"""The model that a log begins with."""

from __future__ import annotations

import numpy as np
import pytest

from idloop.records.recognition.model_start import start_model
from idloop.records.record import Record

T = np.arange(4000) * 0.005


def _record(ratio, stiffness):
    """A motor and a load, each of inertia 0.1, with a spring between them; the load's sensor shows `ratio` times."""
    q, w, rows = np.zeros(2), np.zeros(2), []
    u = np.repeat(np.random.default_rng(0).uniform(-1.0, 1.0, T.size // 50), 50)
    for command in u:
        rows.append(q.copy())
        for _ in range(10):
            torque = stiffness * (q[0] - q[1]) + 0.05 * (w[0] - w[1])
            w += 0.0005 * np.array([(command - torque - 0.2 * w[0]) / 0.1, (torque - 0.2 * w[1]) / 0.1])
            q += 0.0005 * w
    return Record.from_arrays(
        T, u, {"axis.position": np.array(rows)[:, 0], "load.position": ratio * np.array(rows)[:, 1]}, name="run"
    )


@pytest.mark.parametrize("ratio", [1.0, 0.02, -0.5])
def test_a_motor_and_its_load_have_a_spring_and_a_ratio(ratio):
    model = start_model(
        "gear", "axis", "N·m", {"position": "rad"}, load=("load", "rad"), records=[_record(ratio, 20.0)]
    )
    assert list(model.bodies) == ["axis", "load"]
    assert [one.scale for one in model.outputs] == [1.0, ratio]
    assert model.parameter("axis-load.stiffness").value == pytest.approx(20.0, rel=0.7)
    assert {"axis.inertia", "load.inertia", "axis-load.stiffness", "axis-load.damping"} <= set(model.free)


def test_of_a_command_that_is_no_force_the_gain_is_held():
    model = start_model("gear", "axis", "V", {"position": "rad"}, load=("load", "rad"))
    assert "drive.gain" not in model.free
    assert model.values["drive.gain"] == 1.0
    assert {"axis.inertia", "load.inertia"} <= set(model.free)


def test_of_a_set_point_the_inertia_is_held():
    model = start_model("joint", "axis", "rad", {"position": "rad"})
    assert "axis.inertia" not in model.free
    assert {"drive.proportional", "drive.derivative"} <= set(model.free)
