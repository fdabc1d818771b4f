"""Evaluation of a model: simulation, prediction, force balance, linear part."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from idloop.arrays import Array, Integers
from idloop.errors import InputError
from idloop.physics import kernel
from idloop.physics.conditions import Conditions
from idloop.physics.effect import BODY
from idloop.physics.layout import Layout, lay_out
from idloop.physics.model import Model, values_of


@dataclass(frozen=True)
class Linear:
    """Linear part of a model, dx/dt = A x + B u + G d, y = C x."""

    A: Array  # shape (2n, 2n): states: positions, then velocities of all bodies
    B: Array  # shape (2n,): where the command enters
    C: Array  # shape (p, 2n): outputs
    G: Array  # shape (2n,): where a disturbance force on body 0 enters


class ForceBalance(NamedTuple):
    """Forces along a measured motion."""

    residual: Array  # shape (n, b): equation error of every body: inertia times acceleration minus all modelled forces
    required: Array  # shape (n,): force of the drive that the motion requires

    @property
    def applied(self) -> Array:
        """Force of the drive as commanded (n,)."""
        return np.asarray(self.required - self.residual[:, 0])


def _flat(values: Array) -> Array:
    return np.ascontiguousarray(values, dtype=float)


def _flats(*several: Array) -> tuple[Array, ...]:
    return tuple(map(_flat, several))


def _places(layout: Layout, gain: Array) -> Integers:
    """One of the stacked gains after the other."""
    return np.arange(len(gain) // (2 * layout.bodies + 1))


class Engine:
    """Evaluate a model for values ``theta`` of its free parameters.

    All times are in seconds on one clock, and need not be evenly spaced. A command is held from
    its time on; before the first one it is 0. A measurement comes before a command of the same
    time. Values of ``theta`` that contradict each other, such as a static friction below the kinetic
    one, give results of NaN.

    `model`: the structure and the values of the known parameters.
    """

    def __init__(self, model: Model) -> None:
        self.model = model
        self.free = model.free
        self._values = dict(model.values)

    def layout(self, theta: Array | None = None) -> Layout:
        """Arrays for one set of values."""
        return lay_out(self.model, self.values(theta))

    def values(self, theta: Array | None) -> dict[str, float]:
        """Value of every parameter."""
        values = dict(self._values)
        if theta is not None:
            values.update(zip(self.free, (float(v) for v in theta), strict=True))
        return values

    def is_valid(self, theta: Array | None) -> bool:
        """Whether the values satisfy the conditions between the parameters of every effect."""
        if theta is None:
            return True
        values = self.values(theta)
        return all(active.effect.valid(values_of(active, values)) for active in self.model.effects)

    def initial_state(
        self,
        position: Array | None = None,
        velocity: Array | None = None,
        theta: Array | None = None,
        integral: float = 0.0,
    ) -> Array:
        """State with given motion of the model's bodies (n,), at rest in 0 by default.

        The two halves of a body that compliance splits start together. ``integral`` is what the integral of the loop in
        the drive contributes to its output.
        """
        layout = self.layout(theta)
        state = layout.new_state()
        n = layout.bodies
        starts = [*layout.body_of, n]
        for index in range(len(layout.body_of)):
            part = slice(starts[index], starts[index + 1])
            if position is not None:
                state[kernel.FIRST : kernel.FIRST + n][part] = position[index]
            if velocity is not None:
                state[kernel.FIRST + n : kernel.FIRST + 2 * n][part] = velocity[index]
        if integral != 0.0 and (gain := self.values(theta)["drive.integral"]) != 0.0:
            state[kernel.FIRST + 3 * n] = integral / gain  # the loop acts first, and its integral is its first state
        return state

    def simulate(
        self,
        theta: Array | None,
        input_time: Array,
        command: Array,
        time: Array,
        initial_state: Array | None = None,
        noise: Array | None = None,
        conditions: Conditions | None = None,
    ) -> Array:
        """Free run.

        `theta` (k,): values of the free parameters; those of the model when None. `input_time`, `command` (m,):
        commands, held from their time on. `time` (n,): when the outputs are read. `initial_state`: from
        `initial_state`; at rest by default. Its time is set to the first time. `noise` (n, p): added to the readings
        before quantisation. `conditions`: measured conditions, on the same clock; without them they are at their
        references. Returns shape (n, p).
        """
        layout = self.layout(theta).under(conditions)
        state = self._start(layout, initial_state, input_time, time)
        shape = (len(time), len(self.model.outputs))
        output = np.empty(shape)
        if not self.is_valid(theta):
            return np.full(shape, np.nan)
        disturbed = np.zeros(shape) if noise is None else _flat(noise)
        signals = _flats(input_time, command, time)
        kernel.simulate(layout.axis, *signals, state, layout.new_history(), disturbed, output)
        return output

    def slopes(
        self,
        theta: Array,
        change: Array,
        input_time: Array,
        command: Array,
        time: Array,
        initial_state: Array,
        conditions: Conditions | None = None,
    ) -> Array | None:
        """Derivatives of the outputs of a free run by the free parameters, and by the initial position and velocity.

        `theta` (k,). `change` (k,): small steps of the parameters, of either sign. `input_time`, `command`, `time`,
        `initial_state`, `conditions`: as of `simulate`. Returns shape (k + 2, n, p); NaN for a parameter without a
        derivative. None where only finite differences apply, see `idloop.physics.tangent`.
        """
        from idloop.physics import tangent

        layout = self.layout(theta).under(conditions)
        if not self.is_valid(theta):
            return None
        beside: list[tuple[Layout, float] | None] = []
        for i, size in enumerate(change):
            moved = theta.copy()
            moved[i] += size
            beside.append((self.layout(moved).under(conditions), float(size)) if self.is_valid(moved) else None)
        state = self._start(layout, initial_state, input_time, time)
        return tangent.slopes(layout, beside, _flat(input_time), _flat(command), _flat(time), state)

    def predict(
        self,
        theta: Array | None,
        input_time: Array,
        command: Array,
        time: Array,
        measured: Array,
        gain: Array,
        initial_state: Array | None = None,
        decay: float = 1.0,
        place: Integers | None = None,
        conditions: Conditions | None = None,
    ) -> Array:
        """Innovations of the one-step predictor.

        `measured` (n, p): measurements; NaN where there is none. `gain` (m (2 b + 1), p): observer gain on positions,
        velocities and the disturbance force; b bodies after compliance has split some. Of m stacked gains, each is used
        for one of the first measurements and the last for all that follow. `decay`: share of the disturbance force that
        remains after one sample. `place`: index of the gain for each of the first measurements, the last entry for all
        that follow; one gain after the other when left out. `conditions`: as of `simulate`. Returns shape (n, p);
        measured minus predicted.
        """
        layout = self.layout(theta).under(conditions)
        place = _places(layout, gain) if place is None else place
        state = self._start(layout, initial_state, input_time, time)
        innovation = np.empty((len(time), len(self.model.outputs)))
        if not self.is_valid(theta):
            return np.full_like(innovation, np.nan)
        signals = _flats(input_time, command, time, measured, gain)
        kernel.predict(layout.axis, *signals, place, decay, state, layout.new_history(), innovation)
        return innovation

    def predict_ahead(
        self,
        theta: Array | None,
        input_time: Array,
        command: Array,
        time: Array,
        measured: Array,
        gain: Array,
        steps: int,
        initial_state: Array | None = None,
        place: Integers | None = None,
        conditions: Conditions | None = None,
    ) -> Array:
        """Prediction of each sample from the measurements up to ``steps`` samples before it.

        `theta`, `input_time`, `command`, `time`, `initial_state`, `conditions`: as of `simulate`. `measured` (n, p):
        measurements; NaN where there is none. `gain`, `place`: observer gains, as of `predict`. `steps`: prediction
        horizon in samples. Returns shape (n, p); NaN for the first ``steps`` samples. Raises InputError: ``steps`` is
        not at least 1 and below the number of samples.
        """
        if not 1 <= steps < len(time):
            raise InputError(f"cannot predict {steps} steps ahead in {len(time)} samples; choose 1 .. {len(time) - 1}")
        layout = self.layout(theta).under(conditions)
        place = _places(layout, gain) if place is None else place
        state = self._start(layout, initial_state, input_time, time)
        prediction = np.full(measured.shape, np.nan)
        signals = _flats(input_time, command, time, measured, gain)
        kernel.predict_ahead(layout.axis, *signals, place, steps, state, layout.new_history(), prediction)
        return prediction

    def balance(
        self,
        theta: Array | None,
        position: Array,
        velocity: Array,
        acceleration: Array,
        input_time: Array,
        command: Array,
        time: Array,
        rest_speed: float = 0.0,
        conditions: Conditions | None = None,
    ) -> ForceBalance:
        """Force balance along a measured motion.

        `theta`, `input_time`, `command`, `time`, `conditions`: as of `simulate`. `position`, `velocity`, `acceleration`
        (n, b): motion of every body. `rest_speed`: speed below which a body counts as standing: dry friction then
        balances the other forces.
        """
        layout = self.layout(theta).under(conditions)
        residual = np.empty((len(time), layout.bodies))
        required = np.empty(len(time))
        if not self.is_valid(theta):
            return ForceBalance(np.full_like(residual, np.nan), np.full_like(required, np.nan))
        motion = (part.reshape(len(time), -1) for part in _flats(position, velocity, acceleration))
        sent = _flats(input_time, command)
        kernel.balance(
            layout.axis, _flat(time), *motion, *sent, float(rest_speed), layout.new_state(), residual, required
        )
        return ForceBalance(residual, required)

    def linearise(self, theta: Array | None = None) -> Linear:
        """Linear part: inertia, viscous friction, springs and the effects that are linear."""
        layout = self.layout(theta)
        axis, n = layout.axis, layout.bodies
        a = axis.chain.copy()
        values = self.values(theta)
        body_of = dict(zip(self.model.bodies, layout.body_of, strict=True))
        for active in self.model.effects:
            effect = active.effect
            if effect.linear and effect.site == BODY and effect.force is not None:
                numbers = [values[f"{active.name}.{spec.name}"] for spec in effect.parameters]
                i = body_of[active.at]
                at_rest = effect.force(0.0, 0.0, axis.inertia[i], 0.0, [], numbers)
                for state, motion in ((i, (1.0, 0.0)), (n + i, (0.0, 1.0))):
                    force = effect.force(*motion, axis.inertia[i], 0.0, [], numbers)
                    a[n + i, state] += (force - at_rest) / axis.inertia[i]
        g = np.zeros(2 * n)
        g[n] = 1.0 / axis.inertia[0]
        drive, loop = float(axis.constants[kernel.GAIN]) * g, self.model.loop_gains(values)
        a[:, 0] += loop.position * drive
        a[:, n] += loop.velocity * drive
        c = np.zeros((len(self.model.outputs), 2 * n))
        for j, (body, kind) in enumerate(axis.outputs):
            c[j, body + (n if kind == kernel.VELOCITY else 0)] = axis.output_scale[j]
        return Linear(a, loop.set_point * drive, c, g)

    @staticmethod
    def _start(layout: Layout, initial_state: Array | None, input_time: Array, time: Array) -> Array:
        """Initial state at the first of the times."""
        state = layout.new_state()
        if initial_state is not None:
            state[kernel.DISTURBANCE :] = initial_state[kernel.DISTURBANCE :]
        state[kernel.TIME] = time[0]
        # The last command that acts before the start.
        first = np.searchsorted(input_time, time[0] - layout.axis.constants[kernel.DELAY], side="left") - 1
        state[kernel.COMMAND] = float(max(first, -1))
        return state
