"""Stops and starts of bodies with dry friction against an exact solution, however short they are beside a step.

Between two of them the motion is linear, so the reference goes by matrix exponentials, from one to the next.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.linalg import expm

from idloop.physics import Engine, Model, load_model, simulate
from idloop.physics.model_file import from_text

Array = NDArray[np.float64]

# The reference finds each stop and start to this many halvings of its step.
HALVINGS = 30
# Errors, as parts of the motion, that Runge-Kutta's method leaves of a vibration, in its longest steps and where
# a slip makes them short; friction's stops and starts shall add none.
LONG_STEPS, SHORT_STEPS = 2e-4, 2e-5


class Reference:
    """Bodies with Coulomb friction in a linear system, its states positions, velocities and others.

    Parameters
    ----------
    system, drive : ndarray
        What the states and a held command add to the derivative of the states.
    inertia, level : ndarray (n,)
        Of the bodies.
    step : float
        Two events of one body within it are not seen [s].
    """

    def __init__(self, system: Array, drive: Array, inertia: Array, level: Array, step: float) -> None:
        self.bodies, self.inertia, self.level = len(inertia), inertia, level
        states, n = len(system), len(inertia)
        self.rate = np.zeros((states + 1 + n, states + 1 + n))
        self.rate[:states, :states], self.rate[:states, states] = system, drive
        self.rate[n : 2 * n, states + 1 :] = -np.diag(level / inertia)
        self.states, self.step = states, step
        self._flows: dict[tuple[bool, ...], list[Array]] = {}

    def run(self, command: Array, pieces: int) -> Array:
        """Positions and velocities at the start of each command, which holds for so many steps."""
        state = np.zeros(len(self.rate))
        motion = np.empty((len(command), 2 * self.bodies))
        for k, value in enumerate(command):
            motion[k] = state[: 2 * self.bodies]
            state[self.states] = value
            self._begin(state)
            for _ in range(pieces):
                state = self._advance(state, 0)
        return motion

    def _force(self, state: Array) -> Array:
        """Force on each body but its dry friction."""
        return self.inertia * (self.rate[self.bodies : 2 * self.bodies, : self.states + 1] @ state[: self.states + 1])

    def _begin(self, state: Array) -> None:
        """Set the directions of friction, 0 where it holds."""
        speed, force = state[self.bodies : 2 * self.bodies], self._force(state)
        breaks = np.where(np.abs(force) > self.level, np.sign(force), 0.0)
        state[self.states + 1 :] = np.where(speed != 0.0, np.sign(speed), breaks)

    def _advance(self, state: Array, halving: int) -> Array:
        """One step, by halves where a body stops or breaks away in it."""
        direction = state[self.states + 1 :]
        end = self._flow(direction)[halving] @ state
        speed = end[self.bodies : 2 * self.bodies]
        held = (direction == 0.0) & (self.level > 0.0)
        stops = (speed * direction < 0.0) & (self.level > 0.0)
        if not np.any(stops | (held & (np.abs(self._force(end)) > self.level))):
            return end
        if halving == HALVINGS:
            speed[stops] = 0.0
            self._begin(end)
            return end
        return self._advance(self._advance(state, halving + 1), halving + 1)

    def _flow(self, direction: Array) -> list[Array]:
        held = tuple((direction == 0.0) & (self.level > 0.0))
        if held not in self._flows:
            rate = self.rate.copy()
            rate[: 2 * self.bodies][np.tile(held, 2)] = 0.0
            self._flows[held] = [expm(rate * self.step / 2**k) for k in range(HALVINGS + 1)]
        return self._flows[held]


TWO_BODIES = """
schema: idloop/model/1
name: two_bodies
input: {topic: joint_command, joint: motor, field: effort, unit: N·m}
outputs:
  - {topic: joint_states, joint: motor, field: position, unit: rad}
  - {topic: joint_states, joint: load, field: position, unit: rad}
bodies:
  - {name: motor, inertia: {value: 1.5e-3}, viscous_friction: {value: 4.0e-3}}
  - {name: load, inertia: {value: 4.0e-3}, viscous_friction: {value: 6.0e-3}}
couplings:
  - {from: motor, to: load, stiffness: {value: 22.0}, damping: {value: 0.012}}
drive: {gain: 1.0}
"""
SAMPLE_TIME = 0.002


def two_bodies(angle: float, damping: float) -> Model:
    """Two bodies whose vibration turns by an angle [rad] per sample."""
    rate = angle / SAMPLE_TIME
    stiffness = rate**2 / (1.0 / 1.5e-3 + 1.0 / 4e-3)
    return from_text(TWO_BODIES, None).with_values(
        {"motor-load.stiffness": stiffness, "motor-load.damping": 2.0 * damping * stiffness / rate}
    )


def dry(model: Model, level: Array) -> Model:
    """The model with Coulomb friction at its bodies."""
    return model.with_effects(
        [f"coulomb_friction@{body}(level={one})" for body, one in zip(model.bodies, level, strict=True) if one]
    )


def steps_of(seed: int, samples: int, hold: int) -> Array:
    """Command that is held for some samples at a time."""
    return np.repeat(np.random.default_rng(seed).uniform(-0.8, 0.8, samples // hold + 1), hold)[:samples]


def exact(model: Model, level: Array, command: Array) -> Array:
    """Positions (m, n) of a chain of bodies with these levels of friction."""
    linear = Engine(model).linearise()
    pieces = int(np.ceil(SAMPLE_TIME * np.abs(np.linalg.eigvals(linear.A)).max() / 0.03))
    inertia = np.array([model.values[f"{body}.inertia"] for body in model.bodies])
    return Reference(linear.A, linear.B, inertia, level, SAMPLE_TIME / pieces).run(command, pieces)[:, : len(inertia)]


def free_run(model: Model, command: Array) -> Array:
    """Outputs at the time of each command."""
    time = np.arange(len(command)) * SAMPLE_TIME
    return simulate(model, time, command, time).output


@pytest.mark.slow
@settings(max_examples=20)
@given(
    angle=st.floats(0.05, 2.5),
    damping=st.floats(0.003, 0.3),
    motor=st.sampled_from([0.0, 0.02, 0.1, 0.3]),
    load=st.sampled_from([0.02, 0.1, 0.2]),
    seed=st.integers(0, 1000),
    hold=st.integers(1, 12),
)
def test_a_chain_with_dry_friction_is_as_exact_as_one_without(
    angle: float, damping: float, motor: float, load: float, seed: int, hold: int
) -> None:
    bare, level, command = two_bodies(angle, damping), np.array([motor, load]), steps_of(seed, 120, hold)
    expected = exact(bare, level, command)
    model, span = dry(bare, level), max(np.ptp(expected), 1e-6)
    np.testing.assert_allclose(free_run(model, command), expected, atol=LONG_STEPS * span)
    firm = model.with_effect("slip", "motor-load", limit=1e6)  # never reached
    np.testing.assert_allclose(free_run(firm, command), expected, atol=SHORT_STEPS * span)


@pytest.mark.slow
@pytest.mark.parametrize("angle", [0.1, 0.3, 0.6, 1.2, 6.0, 15.0])
@pytest.mark.parametrize("level", [(0.0, 0.18), (0.1, 0.1)])
def test_a_vibrating_chain_stops_and_starts_where_it_should(angle: float, level: tuple[float, float]) -> None:
    bare, command = two_bodies(angle, 0.02), steps_of(3, 200, 7)
    expected = exact(bare, np.array(level), command)
    np.testing.assert_allclose(
        free_run(dry(bare, np.array(level)), command), expected, atol=SHORT_STEPS * np.ptp(expected)
    )


@pytest.mark.parametrize("times", [1.0, 10.0, 100.0])
def test_a_chain_of_four_stops_and_starts_where_it_should(times: float) -> None:
    bare = load_model("torsion")
    bare = bare.with_values({f"{coupling}.stiffness": times for coupling in bare.couplings})
    level, command = np.array([0.01, 0.0, 0.004, 0.002]), steps_of(3, 200, 7)
    expected = exact(bare, level, command)
    np.testing.assert_allclose(free_run(dry(bare, level), command), expected, atol=SHORT_STEPS * np.ptp(expected))


@pytest.mark.parametrize("lag", [0.002, 0.01, 0.05])
def test_a_single_body_behind_a_lag_stops_and_starts_where_it_should(lag: float) -> None:
    inertia, viscous, level, command = 2e-3, 5e-3, 0.2, steps_of(4, 400, 6)
    model = load_model("axis").with_values({"axis.inertia": inertia, "axis.viscous_friction": viscous})
    model = model.with_effects([f"coulomb_friction@axis(level={level})", f"actuator_lag@input(time_constant={lag})"])
    system = np.array([[0.0, 1.0, 0.0], [0.0, -viscous / inertia, 1.0 / inertia], [0.0, 0.0, -1.0 / lag]])
    reference = Reference(
        system, np.array([0.0, 0.0, 1.0 / lag]), np.array([inertia]), np.array([level]), SAMPLE_TIME / 50
    )
    expected = reference.run(command, 50)
    np.testing.assert_allclose(free_run(model, command), expected, atol=SHORT_STEPS * np.ptp(expected))
