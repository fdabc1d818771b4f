"""Sensitivity of the free run of one body to parameters and initial state, by the variational equation.

Small changes of a motion obey dδx/dt = δv, dδv/dt = a_x δx + a_v δv + a_θ, whose coefficients are derivatives of the
acceleration along the motion: one evaluation each, where another run needs four and a search for events. At a reversal
under dry friction the change of the velocity is multiplied by the ratio of the accelerations after and before
(saltation; Leine and Nijmeijer, Dynamics and Bifurcations of Non-Smooth Mechanical Systems, 2004); at rest it is 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numba import njit

from idloop.arrays import Array, Integers, Mask
from idloop.physics import kernel
from idloop.physics.kernel import Axis
from idloop.physics.layout import Layout

# Difference step, relative to the largest position and velocity.
_SHIFT = 1e-6


class Legs(NamedTuple):
    """Parts of a motion, in order, each with one command and one direction of dry friction."""

    # shape (l,): start and length [s]
    time: Array
    duration: Array
    held: Array  # shape (l,): command
    # shape (l,): in the middle
    position: Array
    velocity: Array
    mode: Array  # shape (l,): direction of the dry friction; 0 at rest, and without dry friction
    turned: Mask  # shape (l,): whether it begins with a reversal or a stop
    sample: Integers  # shape (l,): index of the sample at its end, -1 for none

    def at(self, rows: Integers) -> Legs:
        """Some of the legs."""
        return Legs._make(part[rows] for part in self)


def slopes(
    layout: Layout,
    beside: Sequence[tuple[Layout, float] | None],
    input_time: Array,
    command: Array,
    time: Array,
    state: Array,
) -> Array | None:
    """Derivatives of the outputs of a free run by parameters, and by the initial position and velocity.

    `layout`: the model of the run. `beside`: the model with each parameter changed by a small step, and this step; None
    to leave the parameter out. `input_time`, `command` (m,): commands, held from their time [s] on. `time` (n,): when
    the outputs are read [s]. `state`: at the first time. Returns shape (parameters + 2, n, p); NaN for parameters that
    are left out, and for a delay. None where the equation above does not apply: several bodies, effects with memory,
    effects on sensors, steps that are long for the motion.
    """
    axis = layout.axis
    memories = layout.states - kernel.FIRST - 4 - len(layout.wanted)
    plain = layout.bodies == 1 and memories == 0 and len(axis.output_hooks) == 0
    if not plain or layout.delay > 0.0:
        return None
    changes = input_time + axis.constants[kernel.DELAY]
    grid, sample = _instants(changes, time)
    if float(np.max(np.diff(grid), initial=0.0)) * axis.constants[kernel.RATE] > 1.0:
        return None
    motion = _motion(layout, input_time, command, grid, state)
    if not np.all(np.isfinite(motion)):
        return None
    index = np.searchsorted(changes, grid[:-1] + kernel.SAME_TIME, side="right") - 1
    held = np.where(index >= 0, command[np.maximum(index, 0)], 0.0)
    legs = _legs(axis, grid, held, motion, sample[1:], state)
    base = _accelerations(axis, legs, state)
    far, fast = _SHIFT * np.maximum(np.max(np.abs(motion), axis=0), 1e-9)
    by_position = (_accelerations(axis, legs._replace(position=legs.position + far), state) - base) / far
    by_velocity = (_accelerations(axis, legs._replace(velocity=legs.velocity + fast), state) - base) / fast
    factor = _factors(axis, legs, base)
    found = np.full((len(beside) + 2, len(time), len(axis.outputs)), np.nan)
    for column, one in enumerate(beside):
        if one is None or one[0].axis.constants[kernel.DELAY] != axis.constants[kernel.DELAY]:
            continue
        force = (_accelerations(one[0].axis, legs, state) - base) / one[1]
        _carry(legs, factor, by_position, by_velocity, force, 0.0, 0.0, axis.outputs, axis.output_scale, found[column])
    force = np.zeros_like(base)
    for column, (x, v) in enumerate(((1.0, 0.0), (0.0, 1.0)), start=len(beside)):
        _carry(legs, factor, by_position, by_velocity, force, x, v, axis.outputs, axis.output_scale, found[column])
    return found


def _instants(changes: Array, time: Array) -> tuple[Array, Integers]:
    """Times of samples and of commands between them, with the index of the sample (-1: a command)."""
    inside = changes[(changes > time[0] + kernel.SAME_TIME) & (changes < time[-1] - kernel.SAME_TIME)]
    next_ = np.searchsorted(time, inside - kernel.SAME_TIME)
    alone = inside[time[next_] - inside > kernel.SAME_TIME]
    if len(alone) == 0:
        return time, np.arange(len(time))
    grid = np.concatenate([time, alone])
    sample = np.concatenate([np.arange(len(time)), np.full(len(alone), -1)])
    order = np.argsort(grid, kind="stable")
    return grid[order], sample[order]


def _motion(layout: Layout, input_time: Array, command: Array, time: Array, state: Array) -> Array:
    """Position and speed of the body at given times, shape (n, 2)."""
    both = layout.axis._replace(
        outputs=np.array([[0, kernel.POSITION], [0, kernel.VELOCITY]], dtype=np.int64),
        output_scale=np.ones(2),
        output_delay=np.zeros(2),
    )
    motion = np.empty((len(time), 2))
    kernel.simulate(
        both, input_time, command, time, state.copy(), layout.new_history(), np.zeros((len(time), 2)), motion
    )
    return motion


def _legs(axis: Axis, grid: Array, held: Array, motion: Array, sample: Integers, state: Array) -> Legs:
    """Steps of a motion; those with a reversal under dry friction in two parts."""
    time, duration = grid[:-1], np.diff(grid)
    before, after = motion[:-1, 1], motion[1:, 1]
    amid = 0.5 * (motion[:-1, 0] + motion[1:, 0])
    no = np.zeros(len(duration), dtype=bool)
    if not axis.has_friction[0]:
        return Legs(time, duration, held, amid, 0.5 * (before + after), np.zeros(len(duration)), no, sample)
    mode = np.sign(np.where(before != 0.0, before, after))
    turns = (before != 0.0) & (before * after <= 0.0)
    first = Legs(time, duration, held, amid, np.where(turns, 0.5 * before, 0.5 * (before + after)), mode, no, sample)
    if not np.any(turns):
        return first
    at = np.flatnonzero(turns)
    slowing = _accelerations(axis, first.at(at), state)
    with np.errstate(divide="ignore", invalid="ignore"):
        until = np.clip(np.nan_to_num(-before[at] / slowing, nan=np.inf), 0.0, duration[at])
    whole = duration.copy()
    whole[at] = until
    kept = sample.copy()
    kept[at] = -1
    later, kind, yes = duration[at] - until, np.sign(after[at]), np.ones(len(at), bool)
    second = Legs(time[at] + until, later, held[at], amid[at], 0.5 * after[at], kind, yes, sample[at])
    first = first._replace(duration=whole, sample=kept)
    return Legs(*(np.insert(a, at + 1, b) for a, b in zip(first, second, strict=True)))


def _accelerations(axis: Axis, legs: Legs, state: Array) -> Array:
    """Acceleration in the middle of each leg, shape (l,)."""
    acceleration = np.empty(len(legs.duration))
    amid = legs.time + 0.5 * legs.duration
    kernel.accelerations_along(axis, amid, legs.held, legs.position, legs.velocity, legs.mode, state, acceleration)
    return acceleration


def _factors(axis: Axis, legs: Legs, acceleration: Array) -> Array:
    """Saltation factor of the velocity at the start of each leg, shape (l,)."""
    factor = np.ones(len(acceleration))
    if axis.has_friction[0]:
        at = np.flatnonzero(legs.turned)
        with np.errstate(divide="ignore", invalid="ignore"):
            factor[at] = np.nan_to_num(acceleration[at] / acceleration[at - 1], nan=0.0, posinf=0.0, neginf=0.0)
        factor[legs.mode == 0.0] = 0.0
    return factor


@njit(cache=True, error_model="numpy", nogil=True)
def _carry(
    legs: Any, factor: Any, by_position: Any, by_velocity: Any, force: Any, x: float, v: float,
    outputs: Any, scale: Any, found: Any,
) -> None:  # fmt: skip
    """Carry a small change of position and speed along the motion, by the implicit midpoint rule."""
    for output in range(outputs.shape[0]):
        found[0, output] = scale[output] * (x if outputs[output, 1] == 0 else v)
    for leg in range(factor.shape[0]):
        h = legs.duration[leg]
        v *= factor[leg]
        turn = 0.5 * h * by_velocity[leg] + 0.25 * h * h * by_position[leg]
        end = (v * (1.0 + turn) + h * (by_position[leg] * x + force[leg])) / (1.0 - turn)
        x += 0.5 * h * (v + end)
        v = end
        sample = legs.sample[leg]
        if sample >= 0:
            for output in range(outputs.shape[0]):
                found[sample, output] = scale[output] * (x if outputs[output, 1] == 0 else v)
