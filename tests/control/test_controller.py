"""The controller object: limits, faults, resets, its own period."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from idloop.control import build_controller
from idloop.control.step import controller_step
from idloop.errors import InputError

POSITION = "motor.position"
SPECS = {
    "none": {"type": "none"},
    "p": {"type": "p", "output": POSITION, "kp": 3.0},
    "pd": {"type": "pd", "output": POSITION, "kp": 3.0, "kd": 0.2},
    "pid": {"type": "pid", "output": POSITION, "kp": 8.3867, "ki": 0.3255, "kd": 0.8},
    "lead": {"type": "lead", "output": POSITION, "gain": 5.0, "zero": 2.0, "pole": 20.0},
    "cascade": {"type": "cascade", "output": POSITION, "kp": 10.0, "kv": 2.0, "ki": 3.0},
    "state_feedback": {
        "type": "state_feedback",
        "states": [POSITION, "motor.velocity"],
        "gains": [3.0, 0.4],
    },
}
KINDS = sorted(SPECS)


def build(kind, **more):
    return build_controller({**SPECS[kind], "sample_time": 0.01, **more})


@pytest.mark.parametrize("kind", KINDS)
@given(
    samples=st.lists(st.tuples(*[st.floats(-1e6, 1e6)] * 4), min_size=1, max_size=20),
    limit=st.floats(1e-3, 1e3),
    gain=st.floats(-10.0, 10.0).filter(lambda value: abs(value) > 1e-3),
    offset=st.floats(-5.0, 5.0),
)
def test_the_limit_is_never_passed(kind, samples, limit, gain, offset):
    controller = build(kind, limit=limit, linearisation={"gain": gain, "offset": offset})
    assert controller.limit == limit
    for position, velocity, measured, feedforward in samples:
        y = np.full(len(controller.inputs), measured)
        command = controller.step(position, velocity, y, feedforward)
        assert abs(command) <= limit
        assert not controller.saturated or abs(command) == limit
    assert controller.fault is None


@pytest.mark.parametrize("kind", KINDS)
def test_saturated_is_said_and_taken_back(kind):
    controller = build(kind, limit=1.0)
    y = np.zeros(len(controller.inputs))
    assert controller.step(0.0, 0.0, y, 5.0) == 1.0
    assert controller.saturated
    controller.reset()
    assert controller.step(0.0, 0.0, y, 0.5) == pytest.approx(0.5)
    assert not controller.saturated


@pytest.mark.parametrize("kind", sorted(set(KINDS) - {"none"}))
@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_a_bad_measurement_gives_zero_until_reset(kind, bad):
    controller = build(kind)
    good = np.full(len(controller.inputs), 0.1)
    assert controller.step(1.0, 0.0, good) != 0.0
    worse = good.copy()
    worse[-1] = bad
    assert controller.step(1.0, 0.0, worse, 0.3) == 0.0
    assert controller.fault == "measurement missing or not finite"
    assert controller.step(1.0, 0.0, good, 0.3) == 0.0
    controller.reset()
    assert controller.fault is None
    fresh = build(kind)
    assert controller.step(1.0, 0.0, good) == fresh.step(1.0, 0.0, good)


@pytest.mark.parametrize(
    ("arguments", "fault"),
    [
        ((math.nan, 0.0, [0.0]), "reference not finite"),
        ((0.0, math.inf, [0.0]), "reference not finite"),
        ((0.0, 0.0, [0.0], math.nan), "feedforward not finite"),
        ((1e308, 0.0, [-1e308]), "computed command not finite"),
        ((0.0, 0.0, {}), "measurement missing or not finite"),
    ],
)
def test_every_other_fault_is_named(arguments, fault):
    controller = build("pid", limit=1.0)
    assert controller.step(*arguments) == 0.0
    assert controller.fault == fault


def test_measurements_by_name_or_in_order():
    by_name, in_order = build("state_feedback"), build("state_feedback")
    named = {"motor.velocity": 0.2, "other.position": math.nan, POSITION: 0.1}
    assert by_name.step(1.0, 0.0, named) == in_order.step(1.0, 0.0, [0.1, 0.2])
    with pytest.raises(InputError, match=r"1 measurements given but it reads 2"):
        in_order.step(1.0, 0.0, [0.1])


@pytest.mark.parametrize("kind", KINDS)
def test_reset_forgets_everything(kind):
    controller = build(kind)
    random = np.random.default_rng(2).standard_normal((30, 3))

    def commands():
        n = len(controller.inputs)
        return [controller.step(r, 0.0, np.full(n, y), f) for r, y, f in random]

    first = commands()
    controller.reset()
    assert commands() == first


@pytest.mark.parametrize("kind", ["pid", "cascade"])
@pytest.mark.parametrize("more", [{}, {"linearisation": {"gain": 2.44, "offset": 0.0397}}])
def test_takes_over_without_a_bump(kind, more):
    controller = build(kind, limit=2.0, **more)
    controller.step(5.0, 0.0, [0.0])
    controller.reset(command=0.7)
    assert controller.step(1.0, 0.0, [0.9], feedforward=0.2) == pytest.approx(0.7)
    following = controller.step(1.0, 0.0, [0.9], feedforward=0.2)
    assert following == pytest.approx(0.7, abs=0.05)
    assert following > 0.7


def test_no_derivative_kick_on_the_first_sample():
    for kind in ("pd", "pid", "cascade"):
        controller = build(kind)
        assert controller.step(7.0, 0.0, [7.0]) == pytest.approx(0.0)


def test_reset_command_must_be_finite():
    with pytest.raises(InputError, match="reset command is nan"):
        build("pid").reset(math.nan)


def test_a_new_controller_is_at_rest_with_its_step_loaded():
    controller = build("pid", linearisation={"gain": 2.0, "offset": 0.1}, limit=0.01)
    assert controller_step.signatures
    assert not controller.saturated
    assert controller.fault is None
    assert np.array_equal(controller._state, controller.kernel.state)


def test_none_passes_the_excitation_on():
    controller = build_controller(None)
    assert controller.inputs == ()
    assert controller.limit == math.inf
    assert controller.step(9.0, 9.0, {}, 0.3) == 0.3
