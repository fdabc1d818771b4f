"""A factor beside the data that only one of position and velocity was scaled by scales the other as well."""

from __future__ import annotations

import json

import numpy as np
import pytest

from idloop.api.log import recognise

_PER_TURN = 0.24  # [m]


def _log(tmp_path, *, position=1.0, velocity=1.0, written=_PER_TURN):
    """Write a test of SysId on a wheel, with factors on position and velocity."""
    time = np.arange(800) / 200.0
    place = position * (1.0 - np.cos(3.0 * time))
    speed = velocity * 3.0 * np.sin(3.0 * time)
    rows = np.stack((time, np.sign(np.sin(5.0 * time)), place, speed), axis=1)
    content = {"fast-forward": rows.tolist(), "sysid": True, "units": "Meters", "unitsPerRotation": written}
    path = tmp_path / "sysid.json"
    path.write_text(json.dumps(content), encoding="utf-8")
    return path


def _scales(path):
    found = recognise(path).recognition
    doubts = [doubt for doubt in found.all_doubts() if "unitsPerRotation" in doubt]
    return [found.of(role).options.get("scale", 1.0) for role in ("position", "velocity")], doubts


def test_a_velocity_that_lacks_the_factor(tmp_path):
    scales, doubts = _scales(_log(tmp_path, velocity=1.0 / _PER_TURN))
    assert scales == pytest.approx([1.0, _PER_TURN])
    assert len(doubts) == 1
    assert "--velocity none" in doubts[0]


def test_a_position_that_lacks_the_factor(tmp_path):
    scales, doubts = _scales(_log(tmp_path, position=1.0 / _PER_TURN))
    assert scales == pytest.approx([_PER_TURN, 1.0])
    assert len(doubts) == 1


@pytest.mark.parametrize("written", [1.0, 0.3])
def test_another_factor_explains_nothing(tmp_path, written):
    assert _scales(_log(tmp_path, velocity=1.0 / _PER_TURN, written=written)) == ([1.0, 1.0], [])


def test_what_agrees_is_left(tmp_path):
    assert _scales(_log(tmp_path)) == ([1.0, 1.0], [])
