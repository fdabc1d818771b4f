"""A planned motion read back, held against every limit, and laid from where the arm is."""

from __future__ import annotations

import numpy as np
import pytest

from idloop.errors import InputError
from idloop.robots.excitation import Trajectory, trajectory_text
from idloop.robots.joint_limits import JointLimits
from idloop.robots.joint_path import JointPath, read_path

JOINTS = ("shoulder", "elbow")
TIME = np.linspace(0.0, 4.0, 201)


def limits(lower=-1.0, upper=1.0, velocity=2.0, acceleration=10.0):
    ends = (np.array([one, one]) for one in (lower, upper, velocity, np.inf, acceleration))
    return JointLimits(JOINTS, *ends)


def swing(amplitude=0.5, wave=np.pi):
    """Both joints, from rest to rest: amplitude (1 - cos wave t) / 2, the elbow half as far and negative."""
    position = 0.5 * amplitude * np.outer(1.0 - np.cos(wave * TIME), [1.0, -0.5])
    velocity = 0.5 * amplitude * wave * np.outer(np.sin(wave * TIME), [1.0, -0.5])
    return position, velocity


def path(**more):
    return JointPath(JOINTS, TIME, *swing(**more))


@pytest.mark.parametrize("form", ["csv", "yaml"])
def test_a_planned_trajectory_comes_back(tmp_path, form):
    position, velocity = swing()
    planned = Trajectory(JOINTS, TIME, position, velocity, 0.0 * position, 1.0, 1.0, 1.0, ())
    file = tmp_path / f"trajectory.{form}"
    file.write_text(trajectory_text(planned, form), encoding="utf-8")
    found = read_path(file)
    assert found.joints == JOINTS
    at = np.linspace(0.0, 4.0, 333)
    truth = 0.25 * np.outer(1.0 - np.cos(np.pi * at), [1.0, -0.5])
    slope = 0.25 * np.pi * np.outer(np.sin(np.pi * at), [1.0, -0.5])
    place, speed = found.at(at)
    np.testing.assert_allclose(place, truth, atol=1e-7)
    np.testing.assert_allclose(speed, slope, atol=2e-5)


def test_beyond_its_ends_it_rests():
    place, speed = path().at(np.array([-1.0, 5.0]))
    np.testing.assert_allclose(place, [[0.0, 0.0], [0.0, 0.0]], atol=1e-12)
    np.testing.assert_allclose(speed, 0.0, atol=1e-12)


def test_on_the_inner_side_of_every_limit_it_passes():
    # Largest: position 0.5, speed 0.785, |q''| + |q'| / stop_time at the phase atan(1 / (wave stop_time)).
    push = 0.25 * np.pi**2 * np.hypot(1.0, 1.0 / (np.pi * 0.5))
    path().refuse(limits(upper=0.5001, velocity=0.7855, acceleration=1.001 * push), 0.5)


@pytest.mark.parametrize(
    ("bounds", "said"),
    [
        ({"upper": 0.499}, "takes shoulder to 0.5 after 1 s, beyond its limits -1 .. 0.499"),
        ({"lower": -0.249}, "takes elbow to -0.25 after 1 s, beyond its limits -0.249 .. 1"),
        ({"velocity": 0.78}, "moves shoulder at 0.7854 after 0.5 s, beyond its velocity limit 0.78"),
        ({"acceleration": 2.9}, "needs an acceleration of 2.92. of shoulder to be stopped in 0.5 s"),
    ],
)
def test_on_the_outer_side_of_a_limit_it_is_refused_in_one_line(bounds, said):
    with pytest.raises(InputError, match=said) as caught:
        path().refuse(limits(**bounds), 0.5)
    assert "\n" not in str(caught.value)


def test_a_joint_without_limits_of_position_may_turn():
    path(amplitude=0.9).refuse(limits(lower=-np.inf, upper=np.inf), 0.5)


@pytest.mark.parametrize(("row", "word"), [(0, "begin"), (-1, "end")])
def test_it_must_begin_and_end_at_rest(row, word):
    position, velocity = swing()
    velocity[row, 1] = 0.1
    with pytest.raises(InputError, match=f"does not {word} at rest: elbow moves"):
        JointPath(JOINTS, TIME, position, velocity).refuse(limits(), 0.5)


@pytest.mark.parametrize("away", [0.0, 1e-6, 0.05, 0.8])
def test_the_line_to_the_beginning_is_within_the_limits_however_far(away):
    start = np.array([away, -0.5 * away])
    whole = path().approached_from(start, limits(), 0.2, 0.5)
    whole.refuse(limits(), 0.5)
    place, speed = whole.at(np.array([0.0, whole.duration - 4.0, whole.duration - 3.0]))
    np.testing.assert_allclose(place, [start, [0.0, 0.0], [0.5, -0.25]], atol=1e-9)
    np.testing.assert_allclose(speed, 0.0, atol=1e-9)
    line = whole.at(np.linspace(0.0, whole.duration - 4.0, 100))[1]
    assert np.max(np.abs(line)) <= 0.2 * 2.0 * (1.0 + 1e-9)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("time,a.position,a.velocity\n0,0,0\n", "fewer than two points"),
        ("time,a.position,a.velocity\n0,0,0\n1,nan,0\n", "not finite"),
        ("time,a.position,a.velocity\n0,0,0\n2,0,0\n1,0,0\n", "do not ascend: 1 s comes after a later one"),
        ("time,a.position\n0,0\n1,0\n", "is no trajectory with positions"),
        ("time,a.position,a.velocity\n0,0,x\n", "is no trajectory"),
        ("", "is no trajectory"),
    ],
)
def test_a_file_that_is_none_is_one_line_with_its_name(tmp_path, text, said):
    file = tmp_path / "t.csv"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=said) as caught:
        read_path(file)
    assert str(caught.value).count(str(file)) == 1
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("text", ["joint_names: [a]\npoints: [{positions: [1]}]\n", "[1, 2\n", "x: 1\n"])
def test_a_message_that_is_none_is_one_line_with_its_name(tmp_path, text):
    file = tmp_path / "t.yaml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        read_path(file)
    assert str(caught.value).count(str(file)) == 1
    assert "\n" not in str(caught.value)


def test_a_file_that_is_not_there_is_one_line(tmp_path):
    with pytest.raises(InputError, match=r"t\.yaml: No such file"):
        read_path(tmp_path / "t.yaml")
