"""Arrays of the compiled simulator for a model and values of its parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from idloop.arrays import Array, Integers
from idloop.physics import kernel
from idloop.physics.conditions import Conditions, Wanted
from idloop.physics.effect import BODY, COUPLING, INPUT, OUTPUT
from idloop.physics.hooks import Hook
from idloop.physics.kernel import Axis
from idloop.physics.model import ActiveEffect, Model, values_of

# Largest angle of the fastest mode in one integration step [rad]: the error of such a
# Runge-Kutta step is about 1e-5 of the motion per radian.
STEP_ANGLE = 0.2
# Most integration steps per second, whatever the parameter values.
MOST_STEPS = 2e5
# Of equations of the effects, in the order of `Effect`.
_TABLES = (INPUT, BODY, "friction", COUPLING, OUTPUT)
# A memory that relaxes so much faster than the effect's other motion is in its new state within a step of that.
_RELAXING = 2.0


@dataclass(frozen=True)
class Layout:
    """Arrays of one model with one set of values."""

    axis: Axis  # for the compiled simulator
    bodies: int  # number of bodies after compliance has split some
    body_of: tuple[int, ...]  # index in the chain by body of the model
    joint_of: Mapping[str, int]  # index in the chain by coupling of the model, including those inside split bodies
    states: int  # length of the state vector
    delay: float  # longest delay of a sensor [s]
    wanted: tuple[Wanted, ...] = ()  # site and measured condition of each effect that depends on one

    def under(self, conditions: Conditions | None) -> Layout:
        """The layout under measured conditions; without any they are at their references.

        Raises InputError: a condition that an effect depends on was not recorded.
        """
        if conditions is None or not self.wanted:
            return self
        constants = self.axis.constants.copy()
        constants[kernel.HOLD] = conditions.interval(self.wanted)
        axis = self.axis._replace(
            constants=constants, condition_time=conditions.time, condition=conditions.table(self.wanted)
        )
        return replace(self, axis=axis)

    def new_state(self) -> Array:
        """State at rest at time 0, before the first command."""
        state = np.zeros(self.states)
        state[kernel.COMMAND] = -1.0
        return state

    def new_history(self) -> Array:
        """Buffer of past motion for delayed sensors; empty without any."""
        if self.delay <= 0.0:
            return np.zeros((0, 1))
        rows = int(np.ceil(self.delay * self.history_rate)) + 8
        return np.zeros((rows, 1 + 3 * self.bodies + self.axis.outputs.shape[0]))

    @property
    def history_rate(self) -> float:
        """Most rows per second: integration steps, commands and measurements."""
        return float(self.axis.constants[kernel.RATE]) * 2.0 + 20000.0


class _Chain:
    """Bodies and couplings after compliance has split some bodies."""

    def __init__(self, model: Model, values: Mapping[str, float]) -> None:
        self.inertia: list[float] = []
        self.viscous: list[float] = []
        self.stiffness: list[float] = []
        self.damping: list[float] = []
        self.body_of: list[int] = []
        self.joint_of: dict[str, int] = {}
        splits = {active.at: active for active in model.effects if active.effect.splits}
        couplings = model.couplings
        for index, body in enumerate(model.bodies):
            if index > 0:
                coupling = couplings[index - 1]
                self.joint_of[coupling] = len(self.stiffness)
                self.stiffness.append(values[f"{coupling}.stiffness"])
                self.damping.append(values[f"{coupling}.damping"])
            self.body_of.append(len(self.inertia))
            inertia, viscous = values[f"{body}.inertia"], values[f"{body}.viscous_friction"]
            own = values_of(splits[body], values) if body in splits else None
            if own is None or not np.isfinite(own["stiffness"]):
                self.inertia.append(inertia)
                self.viscous.append(viscous)
                continue
            self.inertia += [inertia * (1.0 - own["split"]), inertia * own["split"]]
            self.viscous += [viscous * (1.0 - own["viscous_split"]), viscous * own["viscous_split"]]
            self.joint_of[model.inside(body)] = len(self.stiffness)
            self.stiffness.append(own["stiffness"])
            self.damping.append(own["damping"])

    def matrix(self) -> Array:
        """Of the bare chain's motion, d(positions, velocities)/dt, shape (2 n, 2 n)."""
        n = len(self.inertia)
        # Entry by entry: several times as fast as block arrays of this size, and a fit does it at every step.
        matrix = np.zeros((2 * n, 2 * n))
        inverse = (1.0 / np.asarray(self.inertia)).tolist()
        rows = [[0.0] * (2 * n) for _ in range(n)]
        for i, (row, viscous) in enumerate(zip(rows, self.viscous, strict=True)):
            matrix[i, n + i] = 1.0
            row[n + i] = viscous
        for i, (k, c) in enumerate(zip(self.stiffness, self.damping, strict=True)):
            for at, force in ((i, k), (n + i, c)):
                rows[i][at] += force
                rows[i][at + 1] -= force
                rows[i + 1][at] -= force
                rows[i + 1][at + 1] += force
        matrix[n:] = [[-factor * force for force in row] for factor, row in zip(inverse, rows, strict=True)]
        return matrix


def _fastest(matrix: Array) -> float:
    """Fastest rate of a motion [rad/s]."""
    if not np.all(np.isfinite(matrix)):
        return float("inf")
    if len(matrix) == 2:  # a single body with viscous friction
        return float(abs(matrix[1, 1]))
    return float(np.max(np.abs(np.linalg.eigvals(matrix))))


def _closed_loop(model: Model, values: Mapping[str, float], chain: _Chain) -> Array:
    """What the loop of the drive adds to the matrix of the motion, shape (2 n, 2 n)."""
    n = len(chain.inertia)
    added = np.zeros((2 * n, 2 * n))
    gains = model.loop_gains(values)
    added[n, 0], added[n, n] = gains.position, gains.velocity
    return added * (values["drive.gain"] / chain.inertia[0])


def _loop_rate(model: Model, values: Mapping[str, float], chain: _Chain) -> float:
    """Rate of the first body under the loop alone [rad/s]."""
    added = _closed_loop(model, values, chain)
    n = len(chain.inertia)
    return float(np.sqrt(abs(added[n, 0])) + abs(added[n, n]))


def _table(rows: list[list[int]]) -> Integers:
    return np.array(rows, dtype=np.int64).reshape(len(rows), 7)


def lay_out(model: Model, values: Mapping[str, float] | None = None, *, final: bool = True) -> Layout:
    """Lay a model out for the compiled simulator.

    `model`: the structure.
    `values`: value of every parameter by name; those of the model by default.
    `final`: with the effects that act after the noise of the sensors.
    """
    values = model.values if values is None else values
    chain = _Chain(model, values)
    n = len(chain.inertia)
    body_of = dict(zip(model.bodies, chain.body_of, strict=True))
    output_of = {output.site: index for index, output in enumerate(model.outputs)}
    output_delay = np.zeros(len(model.outputs))
    tables: dict[str, list[list[int]]] = {kind: [] for kind in _TABLES}
    has_friction = np.zeros(n, dtype=np.int64)
    spatial = np.zeros((n, 3))
    conditioned: list[list[int]] = []
    wanted: list[Wanted] = []
    numbers: list[float] = []
    next_state = kernel.FIRST + 3 * n
    input_delay = 0.0
    matrix = chain.matrix()
    rate, beyond = _fastest(matrix), 0.0
    if model.loop is not None:
        rate, beyond = _fastest(matrix + _closed_loop(model, values, chain)), _loop_rate(model, values, chain)

    for active in model.acting:
        effect = active.effect
        own = values_of(active, values)
        # No effect acts inside a body that is not split, or with an infinite stiffness.
        nowhere = effect.site == COUPLING and active.at not in chain.joint_of
        if effect.splits or nowhere or (effect.final and not final):
            continue
        if effect.delay:
            if effect.site == INPUT:
                input_delay += own[effect.delay]
            else:
                output_delay[output_of[active.at]] += own[effect.delay]
            continue
        site, inertia, stiffness = 0, chain.inertia[0] / max(abs(values["drive.gain"]), 1e-300), 0.0
        if effect.site == BODY:
            site = body_of[active.at]
            inertia = chain.inertia[site]
        elif effect.site == COUPLING:
            site = chain.joint_of[active.at]
            inertia, stiffness = min(chain.inertia[site : site + 2]), chain.stiffness[site]
        elif effect.site == OUTPUT:
            site = output_of[active.at]
        own_rate = effect.rate(own, inertia, stiffness)
        beyond += own_rate
        if effect.site == BODY:
            column = 1 if effect.relaxes else 0
            spatial[site, column] = max(spatial[site, column], effect.spatial_rate(own, inertia, stiffness))
            if effect.relaxes:
                spatial[site, 2] = max(spatial[site, 2], _RELAXING * own_rate)
        settle = effect.settle.address if effect.settle is not None else 0
        edge = effect.edge.address if effect.edge is not None else 0
        if effect.condition:
            place = [spec.name for spec in effect.parameters].index(effect.reference)
            conditioned.append([next_state, len(numbers) + place])
            wanted.append((active.at, effect.condition))
        if effect.set_point and model.loop is not None:
            noted = effect.set_point[model.loop.effect.name].address
            tables[INPUT].insert(0, [site, noted, settle, len(numbers), next_state, 0, 0])
            settle = 0
        for kind, equation in _equations(active):
            row = [site, equation.address, settle, len(numbers), next_state, int(effect.final), edge]
            tables[kind].append(row)
            if kind == "friction":
                has_friction[site] = 1
        numbers += [own[spec.name] for spec in effect.parameters]
        next_state += effect.states
    # The system is time invariant, so that a common delay of all sensors is moved to the command: the observer then
    # corrects the present motion.
    common = float(np.min(output_delay))
    input_delay, output_delay = input_delay + common, output_delay - common

    constants = [
        values["drive.gain"], input_delay, min((rate + beyond) / STEP_ANGLE, MOST_STEPS), MOST_STEPS,
        beyond / STEP_ANGLE, np.inf, kernel.address_of_advance(),
    ]  # fmt: skip
    kinds = {"position": kernel.POSITION, "velocity": kernel.VELOCITY}
    axis = Axis(
        inertia=np.asarray(chain.inertia, dtype=float),
        viscous=np.asarray(chain.viscous, dtype=float),
        stiffness=np.asarray(chain.stiffness, dtype=float),
        damping=np.asarray(chain.damping, dtype=float),
        chain=matrix,
        constants=np.array(constants),
        spatial_rate=spatial / STEP_ANGLE,
        parameters=np.array([*numbers, 0.0]),
        input_hooks=_table(tables[INPUT]),
        body_hooks=_table(tables[BODY]),
        friction_hooks=_table(tables["friction"]),
        coupling_hooks=_table(tables[COUPLING]),
        output_hooks=_table(tables[OUTPUT]),
        outputs=np.array([[body_of[one.body], kinds[one.field]] for one in model.outputs], dtype=np.int64),
        output_scale=np.array([output.scale for output in model.outputs]),
        output_delay=output_delay,
        has_friction=has_friction,
        condition_hooks=np.array(conditioned, dtype=np.int64).reshape(len(conditioned), 2),
        condition_time=np.zeros(0),
        condition=np.zeros((0, len(conditioned))),
    )
    delay = float(np.max(output_delay, initial=0.0))
    return Layout(axis, n, tuple(chain.body_of), chain.joint_of, next_state + 1, delay, tuple(wanted))


def _equations(active: ActiveEffect) -> list[tuple[str, Hook]]:
    """Equations of an effect with the table of each."""
    effect = active.effect
    hooks = (effect.command, effect.force, effect.friction, effect.coupling, effect.reading)
    return [(kind, hook) for kind, hook in zip(_TABLES, hooks, strict=True) if hook is not None]
