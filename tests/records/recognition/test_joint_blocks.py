"""Tables of an arm without names: blocks of positions, velocities and forces are told by their slopes."""

from __future__ import annotations

import numpy as np
import pytest

from idloop.api.log import recognise
from idloop.errors import InputError

T = np.arange(3000) * 0.005
JOINTS = 6


def _blocks(still=()):
    """Positions, velocities, accelerations, forces and set-points of joints that move along sums of sines."""
    rng = np.random.default_rng(0)
    found = {name: [] for name in "qvatd"}
    for joint in range(JOINTS):
        rates, sizes = 2.0 * np.pi * rng.uniform(0.1, 1.2, 5), rng.normal(size=5) * (joint not in still)
        angle = rates * T[:, None] + rng.uniform(0.0, 6.0, 5)
        place, speed = np.sin(angle) @ (sizes / rates), np.cos(angle) @ sizes
        change = -np.sin(angle) @ (sizes * rates)
        force = 0.5 * change + 1.2 * np.sign(speed) + 0.8 * speed + 3.0 * np.cos(place) * (joint in (1, 2))
        noise = rng.normal(size=(4, T.size))
        found["q"].append(place + 1e-4 * noise[0])
        found["v"].append(speed + 1e-2 * noise[1])
        found["a"].append(change + 0.1 * noise[2])
        found["t"].append(force + 0.05 * noise[3])
        found["d"].append(place + 1e-3)
    return found


def _table(path, order, still=(), *, stamps=True):
    found = _blocks(still)
    columns = [column for name in order for column in found[name]]
    np.savetxt(path, np.column_stack([T, *columns] if stamps else columns), fmt="%.7g")
    return path


@pytest.mark.parametrize("still", [(), (0, 3), (5,), (0, 1, 2, 4, 5)])
@pytest.mark.parametrize("order", ["qvt", "tqv", "qvat", "dqvt"])
def test_motion_and_force_of_the_joint_that_moves_most(tmp_path, order, still):
    found = recognise(_table(tmp_path / "arm.txt", order, still))
    roles = {one.role: int(one.column) for one in found.recognition.guesses}
    blocks = {"command": "t", "position": "q", "velocity": "v"} | ({"reference": "d"} if "d" in order else {})
    assert roles.keys() == blocks.keys()
    assert len({column - JOINTS * order.index(blocks[role]) for role, column in roles.items()}) == 1
    assert found.recognition.joints == ("1", "2", "3", "4", "5", "6")
    assert any("taken as those of 6 joints" in doubt for doubt in found.doubts)


def test_another_joint_by_a_column_of_it_and_a_table_without_stamps(tmp_path):
    path = _table(tmp_path / "arm.txt", "qvt", stamps=False)
    found = recognise(path, {"position": "3"}, period=0.005).recognition
    assert [one.column for one in found.guesses] == ["15", "3", "9"]


def test_columns_that_run_with_no_slope_are_no_joints(tmp_path):
    rng = np.random.default_rng(1)
    np.savetxt(tmp_path / "noise.txt", np.column_stack([T, rng.normal(size=(T.size, 12))]), fmt="%.7g")
    with pytest.raises(InputError, match="no column is a position"):
        recognise(tmp_path / "noise.txt")


def test_set_points_beside_what_follows_them_are_no_joints(tmp_path):
    found = _blocks()
    place, speed, force = (found[name][0] for name in "qvt")
    columns = [place + 1e-3, place, speed + 1e-3, speed, force, np.roll(force, 40)]
    np.savetxt(tmp_path / "axis.txt", np.column_stack([T, *columns]), fmt="%.7g")
    assert not any("joints" in doubt for doubt in recognise(tmp_path / "axis.txt").doubts)


def test_forces_on_top_of_a_constant_are_no_velocities(tmp_path):
    rng = np.random.default_rng(2)
    place = 0.02 * (1.0 - np.cos(0.4 * T))
    force = 250.0 + 8.0 * np.tanh(400.0 * 0.02 * 0.4 * np.sin(0.4 * T)) + 0.1 * rng.normal(size=T.size)
    pressure = 5.0 + 0.02 * rng.normal(size=T.size)
    raw = [place * 80.0 + 3.0, pressure / 2.0, force / 50.0]
    noise = 1e-4 * rng.normal(size=(3, T.size))
    columns = [*(one + more for one, more in zip(raw, noise, strict=True)), place, pressure, force]
    np.savetxt(tmp_path / "cylinder.txt", np.column_stack([T, *columns]), fmt="%.6g")
    with pytest.raises(InputError, match="no column is a position"):
        recognise(tmp_path / "cylinder.txt")
    found = recognise(tmp_path / "cylinder.txt", {"position": "4=m", "command": "6=N"})
    assert not any("joints" in doubt for doubt in found.doubts)
