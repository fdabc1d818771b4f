"""A factor beside the data that only one of position and velocity was scaled by scales the other as well."""

from __future__ import annotations

import json

import numpy as np
import pytest

from idloop.api.log import recognise

_PER_TURN = 0.24  # [m]


def _log(tmp_path, *, position=1.0, velocity=1.0, written=_PER_TURN):
    """Write two tests of SysId on a wheel, both from the same place, with factors on position and velocity."""
    time = np.arange(800) / 200.0
    tests = {}
    for begin, name, way in ((0.0, "slow-forward", 0.1), (10.0, "fast-backward", -1.0)):
        place = way * position * (1.0 - np.cos(0.7 * time))
        speed = way * velocity * 0.7 * np.sin(0.7 * time)
        tests[name] = np.stack((begin + time, way * np.sign(np.sin(5.0 * time)), place, speed), axis=1).tolist()
    content = {**tests, "sysid": True, "units": "Meters", "unitsPerRotation": written}
    path = tmp_path / "sysid.json"
    path.write_text(json.dumps(content), encoding="utf-8")
    return path


def _scales(path, **given):
    found = recognise(path, given).recognition
    doubts = [doubt for doubt in found.all_doubts() if "unitsPerRotation" in doubt]
    return [found.of(role).options.get("scale", 1.0) for role in ("position", "velocity")], doubts


def test_a_velocity_that_lacks_the_factor(tmp_path):
    scales, doubts = _scales(_log(tmp_path, velocity=1.0 / _PER_TURN))
    assert scales == pytest.approx([1.0, _PER_TURN])
    assert len(doubts) == 1
    assert doubts[0].endswith("--velocity 'velocity=m/s'")


def test_a_position_that_lacks_the_factor(tmp_path):
    scales, doubts = _scales(_log(tmp_path, position=1.0 / _PER_TURN))
    assert scales == pytest.approx([_PER_TURN, 1.0])
    assert len(doubts) == 1


@pytest.mark.parametrize("written", [1.0, 0.3])
def test_another_factor_explains_nothing(tmp_path, written):
    assert _scales(_log(tmp_path, velocity=1.0 / _PER_TURN, written=written)) == ([1.0, 1.0], [])


def test_what_agrees_is_left(tmp_path):
    assert _scales(_log(tmp_path)) == ([1.0, 1.0], [])


def test_a_unit_that_the_user_gives_is_not_scaled(tmp_path):
    scales, doubts = _scales(_log(tmp_path, velocity=1.0 / _PER_TURN), velocity="velocity=m/s")
    assert (scales, doubts) == ([1.0, 1.0], [])
