"""A model made ready for many evaluations: simulation, prediction, force balance, linear part."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from idloop.physics import kernel
from idloop.physics.conditions import Conditions
from idloop.physics.effect import BODY
from idloop.physics.layout import Layout, lay_out
from idloop.physics.model import Model, values_of

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Linear:
    """Linear part of a model, dx/dt = A x + B u + G d, y = C x.

    Attributes
    ----------
    A : ndarray (2n, 2n)
        States: positions, then velocities of all bodies.
    B : ndarray (2n,)
        Where the command enters.
    C : ndarray (p, 2n)
        Outputs.
    G : ndarray (2n,)
        Where a disturbance force on body 0 enters.
    """

    A: Array
    B: Array
    C: Array
    G: Array


class Engine:
    """Evaluate a model for values ``theta`` of its free parameters.

    Parameters
    ----------
    model : Model
        The structure and the values of the known parameters.

    Notes
    -----
    All times are in seconds on one clock, and need not be evenly spaced. A command is held from
    its time on; before the first one it is 0. A measurement comes before a command of the same
    time. Values of ``theta`` that do not go together, such as a static friction below the kinetic
    one, have no motion: the results are not numbers.
    """

    def __init__(self, model: Model) -> None:
        self.model = model
        self.free = model.free
        self._values = dict(model.values)

    def layout(self, theta: Array | None = None) -> Layout:
        """Arrays for one set of values."""
        return lay_out(self.model, self.values(theta))

    def _under(self, theta: Array | None, conditions: Conditions | None) -> Layout:
        """Arrays for one set of values and the conditions of one record."""
        return self.layout(theta).under(conditions)

    def values(self, theta: Array | None) -> dict[str, float]:
        """Value of every parameter."""
        values = dict(self._values)
        if theta is not None:
            values.update(zip(self.free, (float(v) for v in theta), strict=True))
        return values

    def go_together(self, theta: Array | None) -> bool:
        """Whether a search has come to values that make every effect what it is; others give no motion."""
        if theta is None:
            return True
        values = self.values(theta)
        return all(active.effect.valid(values_of(active, values)) for active in self.model.effects)

    def initial_state(
        self, position: Array | None = None, velocity: Array | None = None, theta: Array | None = None
    ) -> Array:
        """State with given motion of the model's bodies (n,), at rest in 0 by default.

        The two halves of a body that compliance splits start together.
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

        Parameters
        ----------
        theta : ndarray (k,) or None
            Values of the free parameters; those of the model when None.
        input_time, command : ndarray (m,)
            Commands, held from their time on.
        time : ndarray (n,)
            When the outputs are read.
        initial_state : ndarray, optional
            From `initial_state`; at rest by default. Its time is set to the first time.
        noise : ndarray (n, p), optional
            Added to the readings before quantisation.
        conditions : Conditions, optional
            Measured conditions, on the same clock; without them what depends on one acts as at its reference.

        Returns
        -------
        ndarray (n, p)
        """
        layout = self._under(theta, conditions)
        state = self._start(layout, initial_state, input_time, time)
        shape = (len(time), len(self.model.outputs))
        output = np.empty(shape)
        if not self.go_together(theta):
            return np.full(shape, np.nan)
        disturbed = np.zeros(shape) if noise is None else np.ascontiguousarray(noise, dtype=float)
        kernel.simulate(
            layout.axis,
            np.ascontiguousarray(input_time, dtype=float),
            np.ascontiguousarray(command, dtype=float),
            np.ascontiguousarray(time, dtype=float),
            state,
            layout.new_history(),
            disturbed,
            output,
        )
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
        """Slopes of a free run's outputs by the free parameters, and by the first position and speed.

        Parameters
        ----------
        theta : ndarray (k,)
        change : ndarray (k,)
            Small changes of the parameters, to either side.
        input_time, command, time, initial_state, conditions
            As of `simulate`.

        Returns
        -------
        ndarray (k + 2, n, p), or None
            NaN for a parameter without slopes. None where only differences of runs tell; see `idloop.physics.tangent`.
        """
        from idloop.physics import tangent

        layout = self._under(theta, conditions)
        if not self.go_together(theta):
            return None
        beside: list[tuple[Layout, float] | None] = []
        for i, size in enumerate(change):
            moved = theta.copy()
            moved[i] += size
            beside.append((self._under(moved, conditions), float(size)) if self.go_together(moved) else None)
        state = self._start(layout, initial_state, input_time, time)
        return tangent.slopes(
            layout,
            beside,
            np.ascontiguousarray(input_time, dtype=float),
            np.ascontiguousarray(command, dtype=float),
            np.ascontiguousarray(time, dtype=float),
            state,
        )

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
        place: NDArray[np.int64] | None = None,
        conditions: Conditions | None = None,
    ) -> Array:
        """Innovations of the one-step predictor.

        Parameters
        ----------
        measured : ndarray (n, p)
            Measurements; NaN where there is none.
        gain : ndarray (m (2 b + 1), p)
            Observer gain on positions, velocities and the disturbance force; b bodies after
            compliance has split some. Of m gains one below the other, each serves one of the
            first measurements and the last all that follow.
        decay : float
            Part of the disturbance force that is expected to be left one measurement later.
        place : ndarray of int, optional
            Which gain serves each of the first measurements, the last entry all that follow;
            one gain after the other when left out.
        conditions : Conditions, optional
            As of `simulate`.

        Returns
        -------
        ndarray (n, p)
            Measured minus predicted.
        """
        layout = self._under(theta, conditions)
        if place is None:
            place = np.arange(len(gain) // (2 * layout.bodies + 1))
        state = self._start(layout, initial_state, input_time, time)
        innovation = np.empty((len(time), len(self.model.outputs)))
        if not self.go_together(theta):
            return np.full_like(innovation, np.nan)
        kernel.predict(
            layout.axis,
            np.ascontiguousarray(input_time, dtype=float),
            np.ascontiguousarray(command, dtype=float),
            np.ascontiguousarray(time, dtype=float),
            np.ascontiguousarray(measured, dtype=float),
            np.ascontiguousarray(gain, dtype=float),
            place,
            decay,
            state,
            layout.new_history(),
            innovation,
        )
        return innovation

    def equation_error(
        self,
        theta: Array | None,
        position: Array,
        velocity: Array,
        acceleration: Array,
        input_time: Array,
        command: Array,
        time: Array,
        rest_speed: float = 0.0,
        *,
        undelayed: bool = False,
        conditions: Conditions | None = None,
    ) -> Array:
        """Force that the model leaves unexplained of a measured motion.

        Parameters
        ----------
        position, velocity, acceleration : ndarray (n, b)
            Motion of every body.
        rest_speed : float
            Speed below which a body counts as standing: dry friction then takes what it needs.
        undelayed : bool
            The command comes as late as it acts.
        conditions : Conditions, optional
            As of `simulate`.

        Returns
        -------
        ndarray (n, b)
            Inertia times acceleration minus all modelled forces.
        """
        return self._balance(
            theta,
            position,
            velocity,
            acceleration,
            input_time,
            command,
            time,
            rest_speed,
            undelayed=undelayed,
            conditions=conditions,
        )[0]

    def drive_force(
        self,
        theta: Array | None,
        position: Array,
        velocity: Array,
        acceleration: Array,
        input_time: Array,
        command: Array,
        time: Array,
        rest_speed: float = 0.0,
        *,
        undelayed: bool = False,
        conditions: Conditions | None = None,
    ) -> tuple[Array, Array]:
        """Force of the drive as commanded, and as the model needs it for the measured motion."""
        residual, required = self._balance(
            theta,
            position,
            velocity,
            acceleration,
            input_time,
            command,
            time,
            rest_speed,
            undelayed=undelayed,
            conditions=conditions,
        )
        return required - residual[:, 0], required

    def _balance(
        self,
        theta: Array | None,
        position: Array,
        velocity: Array,
        acceleration: Array,
        input_time: Array,
        command: Array,
        time: Array,
        rest_speed: float,
        *,
        undelayed: bool,
        conditions: Conditions | None,
    ) -> tuple[Array, Array]:
        layout = self._under(theta, conditions)
        axis = layout.axis
        if undelayed and axis.constants[kernel.DELAY] != 0.0:
            constants = axis.constants.copy()
            constants[kernel.DELAY] = 0.0
            axis = axis._replace(constants=constants)
        residual = np.empty((len(time), layout.bodies))
        required = np.empty(len(time))
        if not self.go_together(theta):
            return np.full_like(residual, np.nan), np.full_like(required, np.nan)
        kernel.balance(
            axis,
            np.ascontiguousarray(time, dtype=float),
            np.ascontiguousarray(position, dtype=float).reshape(len(time), -1),
            np.ascontiguousarray(velocity, dtype=float).reshape(len(time), -1),
            np.ascontiguousarray(acceleration, dtype=float).reshape(len(time), -1),
            np.ascontiguousarray(input_time, dtype=float),
            np.ascontiguousarray(command, dtype=float),
            float(rest_speed),
            layout.new_state(),
            residual,
            required,
        )
        return residual, required

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
        c = np.zeros((len(self.model.outputs), 2 * n))
        for j, (body, kind) in enumerate(axis.outputs):
            c[j, body + (n if kind == kernel.VELOCITY else 0)] = axis.output_scale[j]
        return Linear(a, float(axis.constants[kernel.GAIN]) * g, c, g)

    @staticmethod
    def _start(layout: Layout, initial_state: Array | None, input_time: Array, time: Array) -> Array:
        """Fresh state at the first of the times."""
        state = layout.new_state()
        if initial_state is not None:
            motion = slice(kernel.DISTURBANCE, kernel.FIRST + 3 * layout.bodies)
            state[motion] = initial_state[motion]
        state[kernel.TIME] = time[0]
        # commands long past have been followed by the one in force at the start
        first = np.searchsorted(input_time, time[0] - layout.axis.constants[kernel.DELAY], side="left") - 1
        state[kernel.COMMAND] = float(max(first, -1))
        return state
