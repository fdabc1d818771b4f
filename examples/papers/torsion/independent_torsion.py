"""The torsion system by matrix exponentials and impulses; nothing of idloop's physics takes part.

Springs, dampers and inertias are one linear system whose step is exact. What is not linear acts between two halves of
that step: the imbalance as a torque at the angle reached, dry friction as an impulse that takes away at most the
velocity that is there, the slip as the twist that a coupling has lost.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]

SUBSTEPS = 50


@dataclass(frozen=True)
class TorsionMachine:
    """A chain of bodies under a current, with the effects of the thesis.

    Attributes
    ----------
    inertia, viscous : tuple of float
        Of each body [kg·m²], [N·m·s/rad].
    stiffness, damping : tuple of float
        Of each coupling [N·m/rad], [N·m·s/rad].
    torque_constant : float
        [N·m/A]
    offset, limit : float
        Current added to the limited command, and its limit [A].
    friction : float
        Dry friction at the motor [N·m].
    imbalance, phase : float
        Torque against the motor, times sin(angle + phase) [N·m], [rad].
    slip : float
        The most that the first coupling carries [N·m].
    """

    inertia: tuple[float, ...]
    viscous: tuple[float, ...]
    stiffness: tuple[float, ...]
    damping: tuple[float, ...]
    torque_constant: float
    offset: float = 0.0
    limit: float = math.inf
    friction: float = 0.0
    imbalance: float = 0.0
    phase: float = 0.0
    slip: float = math.inf

    def run(
        self, reference: Array, torque: Array, noise: Array, sample_time: float, pid: Mapping[str, float]
    ) -> tuple[Array, Array]:
        """Run from rest under the thesis's PID, which reads the angle of the motor.

        Parameters
        ----------
        reference : ndarray, shape (n,)
            [rad]
        torque : ndarray, shape (n,)
            Disturbance at the motor, held [N·m].
        noise : ndarray, shape (n, bodies)
            Of the encoders [rad].
        sample_time : float
            [s]
        pid : mapping of str to float
            ``kp``, ``ki``, ``kd``, ``derivative_filter`` [s], ``limit`` [A].

        Returns
        -------
        command : ndarray, shape (n,)
            [A]
        angle : ndarray, shape (n, bodies)
            As measured [rad].
        """
        half, drive, lost = self._exact(0.5 * sample_time / SUBSTEPS)
        effects = np.array([self.friction, self.imbalance, self.phase, self.slip])
        first = np.array([self.stiffness[0], self.damping[0], self.inertia[0], sample_time / SUBSTEPS])
        gains = np.array([pid[name] for name in ("kp", "ki", "kd", "derivative_filter", "limit")])
        law = np.array([self.torque_constant, self.offset, self.limit, sample_time])
        command, angle = _run(half, drive, lost, effects, first, gains, law, reference, torque, noise)
        return command, angle

    def _exact(self, step: float) -> tuple[Array, Array, Array]:
        """Transition of the state (angles, velocities) over a step, by a torque at the motor, by a lost twist."""
        from scipy.linalg import expm

        n = len(self.inertia)
        spring, damper = np.zeros((n, n)), np.diag(self.viscous).astype(float)
        for i, (k, d) in enumerate(zip(self.stiffness, self.damping, strict=True)):
            link = np.zeros((n, n))
            link[i : i + 2, i : i + 2] = [[1.0, -1.0], [-1.0, 1.0]]
            spring += k * link
            damper += d * link
        mass = np.diag(1.0 / np.array(self.inertia))
        system = np.zeros((2 * n + 2, 2 * n + 2))
        system[:n, n : 2 * n] = np.eye(n)
        system[n : 2 * n, :n], system[n : 2 * n, n : 2 * n] = -mass @ spring, -mass @ damper
        system[n, 2 * n] = mass[0, 0]
        system[n, 2 * n + 1], system[n + 1, 2 * n + 1] = (mass[i, i] * sign * self.stiffness[0]
                                                          for i, sign in ((0, 1.0), (1, -1.0)))  # fmt: skip
        whole = expm(system * step)
        return whole[: 2 * n, : 2 * n].copy(), whole[: 2 * n, 2 * n].copy(), whole[: 2 * n, 2 * n + 1].copy()


@njit(cache=True)
def _run(half: Array, drive: Array, lost: Array, effects: Array, first: Array, gains: Array, law: Array,
         reference: Array, torque: Array, noise: Array) -> tuple[Array, Array]:  # fmt: skip
    count, n = noise.shape
    friction, imbalance, phase, slip = effects
    stiffness, damping, inertia, step = first
    kp, ki, kd, smooth, limit = gains
    constant, offset, saturation, period = law
    state = np.zeros(2 * n)
    command, angle = np.empty(count), np.empty((count, n))
    integral, slope, twist = 0.0, 0.0, 0.0
    for k in range(count):
        angle[k] = state[:n] + noise[k]
        if k > 0:
            slope = (smooth * slope + angle[k, 0] - angle[k - 1, 0]) / (smooth + period)
        error = reference[k] - angle[k, 0]
        wanted = kp * error + integral - kd * slope
        command[k] = min(max(wanted, -limit), limit)
        if command[k] == wanted or error * wanted < 0.0:
            integral += ki * period * error
        current = min(max(command[k], -saturation), saturation) + offset
        steady = constant * current + torque[k]
        for _ in range(SUBSTEPS):
            state = half @ state + drive * steady + lost * twist
            speed = state[n] - step * imbalance * math.sin(state[0] + phase) / inertia
            taken = step * friction / inertia
            state[n] = 0.0 if abs(speed) <= taken else speed - taken * np.sign(speed)
            state = half @ state + drive * steady + lost * twist
            carried = stiffness * (state[0] - state[1] - twist) + damping * (state[n] - state[n + 1])
            if abs(carried) > slip:
                twist += (carried - slip * np.sign(carried)) / stiffness
    return command, angle
