"""Of two motions beside one command, the one that it drives is taken: a cart, and not the pendulum on it."""

from __future__ import annotations

import numpy as np
import pytest

from idloop.api.log import recognise
from idloop.records.recognition.driven_motion import driven_most

T = 0.01 * np.arange(2000)


def _cart_and_pendulum():
    """Command, place of the cart and angle of the pendulum on it, which swings farther."""
    command = np.repeat(np.random.default_rng(0).normal(size=40), 50)
    place, angle = np.zeros(T.size), np.zeros(T.size)
    speed = rate = 0.0
    for k in range(1, T.size):
        pushed = 3.0 * command[k] - 2.0 * speed
        swung = -19.6 * np.sin(angle[k - 1]) - 2.0 * pushed * np.cos(angle[k - 1]) - 0.1 * rate
        speed, rate = speed + 0.01 * pushed, rate + 0.01 * swung
        place[k], angle[k] = place[k - 1] + 0.01 * speed, angle[k - 1] + 0.01 * rate
    return command, place, angle


@pytest.mark.parametrize(
    ("names", "position"),
    [
        (("x", "theta"), "x"),
        (("arm angle", "pendulum angle"), "arm angle"),
        (("theta1", "theta2"), "theta1"),
        (("theta2", "theta1"), "theta2"),
    ],
)
@pytest.mark.parametrize("turned", [False, True])
def test_the_position_that_the_command_drives(tmp_path, names, position, turned):
    command, *motions = _cart_and_pendulum()
    columns = {"t": T, "voltage": command} | dict(list(zip(names, motions, strict=True))[:: -1 if turned else 1])
    header = ",".join(columns)
    np.savetxt(tmp_path / "log.csv", np.column_stack([*columns.values()]), delimiter=",", header=header, comments="")
    found = recognise(tmp_path / "log.csv")
    assert found.recognition.of("position").column == position
    other = next(name for name in names if name != position)
    assert any(other in doubt and "--position" in doubt for doubt in found.doubts)


def test_the_velocity_is_that_of_the_position(tmp_path):
    command, place, angle = _cart_and_pendulum()
    columns = [T, command, angle, np.gradient(angle, T), place, np.gradient(place, T)]
    header = "t,voltage,theta,theta_dot,x,x_dot"
    np.savetxt(tmp_path / "log.csv", np.column_stack(columns), delimiter=",", header=header, comments="")
    found = recognise(tmp_path / "log.csv").recognition
    assert [(one.role, one.column) for one in found.guesses] == [
        ("command", "voltage"), ("position", "x"), ("velocity", "x_dot")
    ]  # fmt: skip


def test_motions_that_explain_a_command_as_well_as_each_other_are_not_told_apart():
    command, place, angle = _cart_and_pendulum()
    whole = (slice(None),)
    assert driven_most({"cart": place, "pendulum": angle}, command, whole) == "cart"
    assert driven_most({"motor": place, "load": 0.5 * place + 1e-4 * angle}, command, whole) == ""
    assert driven_most({"cart": place, "pendulum": angle}, np.random.default_rng(1).normal(size=T.size), whole) == ""
    assert driven_most({"cart": place}, command, whole) == ""
