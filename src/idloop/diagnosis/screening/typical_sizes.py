"""Typical sizes of a set of records at a site of a model, from which effects choose what to try."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from idloop.estimation.dataset import Data
from idloop.estimation.likelihood.estimation_problem import EstimationProblem
from idloop.estimation.linear.propagate import respond
from idloop.estimation.observer.stationary import discretise
from idloop.estimation.optimisation.caching_engine import CachingEngine
from idloop.physics.conditions import condition_name
from idloop.physics.effect import BODY, COUPLING, INPUT, OUTPUT, Effect, parameter_as
from idloop.physics.model import Model, values_of
from idloop.physics.trial import Scales
from idloop.validation.operating_state import smooth_velocity

Array = NDArray[np.float64]

# Sizes are divided by: none is nothing.
_LEAST = 1e-12


class Sizes:
    """Sizes of motion, forces and outputs of records that a model is fitted to, found once for all sites."""

    def __init__(self, model: Model, estimation: EstimationProblem) -> None:
        self.model, self.estimation = model, estimation
        self.drive_output = np.concatenate([self._drive_output(d) for d in estimation.data])
        self.command = max(float(np.sqrt(np.mean(self.drive_output**2))), _LEAST)
        self.command_most = max(float(np.max(np.abs(self.drive_output))), _LEAST)
        self.duration = float(sum(d.time[-1] - d.time[0] for d in estimation.data))
        self.sample_time = float(np.median([d.sample_time for d in estimation.data]))
        self.bodies = [self._motion(index) for index in range(len(model.bodies))]

    def _drive_output(self, data: Data) -> Array:
        """What the effects at the input act on: the command, or the output of a loop inside the drive."""
        if self.model.loop is None:
            return data.input
        gains, found = self.model.loop_gains(self.model.values), data.held_input()
        position = velocity = None
        for column, output in enumerate(self.model.outputs):
            if output.body == self.model.bodies[0] and np.any(np.isfinite(data.output[:, column])):
                seen = np.isfinite(data.output[:, column])
                value = np.interp(data.time, data.time[seen], data.output[seen, column]) / output.scale
                if output.field == "position":
                    position = value
                else:
                    velocity = value
        if velocity is None and position is not None:
            velocity = smooth_velocity(data.time, position)
        if position is None and velocity is not None:
            position = np.cumsum(velocity) * data.sample_time
        if position is None or velocity is None:
            return found
        return np.asarray(gains.set_point * found + gains.position * position + gains.velocity * velocity)

    def _motion(self, index: int) -> tuple[float, float, float, float]:
        """Speed rms and maximum, middle and span of the positions of a body, or of its nearest neighbour."""
        for other in sorted(range(len(self.model.bodies)), key=lambda other: abs(other - index)):
            measured: dict[str, tuple[int, float]] = {}
            for column, output in enumerate(self.model.outputs):
                if output.body == self.model.bodies[other] and self._measured(column):
                    measured.setdefault(output.field, (column, output.scale))
            position, velocity = measured.get("position"), measured.get("velocity")
            speeds, places = [], []
            for d in self.estimation.data:
                if velocity is not None:
                    speeds.append(_finite(d.output[:, velocity[0]]) / velocity[1])
                elif position is not None:
                    speeds.append(_speed(d, position[0]) / position[1])
                else:
                    break
                if position is not None:
                    places.append(_finite(d.output[:, position[0]]) / position[1])
                else:
                    places.append(np.cumsum(speeds[-1]) * d.sample_time)
            speed, place = np.concatenate([np.zeros(0), *speeds]), np.concatenate([np.zeros(0), *places])
            if len(speed) == 0 or len(place) == 0:
                continue
            span = max(float(np.ptp(place)), _LEAST)
            rms = max(float(np.sqrt(np.mean(speed**2))), 1e-9 * span / self.sample_time, _LEAST)
            most = max(float(np.percentile(np.abs(speed), 99.5)), rms)
            return rms, most, float(0.5 * (np.min(place) + np.max(place))), span
        return 1.0, 1.0, 0.0, 1.0

    def _measured(self, column: int) -> bool:
        return any(np.any(np.isfinite(d.output[:, column])) for d in self.estimation.data)

    def at(self, kind: str, site: str) -> Scales:
        """Sizes at one site."""
        model, body = self.model, 0
        output = noise = twist = torque = torque_most = stiffness = 1.0
        if kind == BODY:
            body = model.bodies.index(site)
        elif kind == OUTPUT:
            place = next(i for i, o in enumerate(model.outputs) if o.site == site)
            body = model.bodies.index(model.outputs[place].body)
            seen = np.concatenate([_finite(d.output[:, place]) for d in self.estimation.data])
            output = max(float(np.sqrt(np.mean(seen**2))), _LEAST) if len(seen) else 1.0
            noise = float(self.estimation.noise[place])
        elif kind == COUPLING:
            inner = model.inner_couplings.get(site)
            body = model.couplings.index(site) + 1 if inner is None else model.bodies.index(inner.at)
            stiffness, torque, torque_most = self._torques[site]
            twist = torque / stiffness
        speed, most, middle, span = self.bodies[body]
        name = model.bodies[body]
        known = self.estimation.conditions
        angle = model.units.position == "rad"
        return Scales(
            command=self.command,
            command_most=self.command_most,
            limit=command_limit(model),
            force=self.estimation.force,
            speed=speed,
            speed_most=most,
            middle=middle,
            span=span,
            twist=twist,
            torque=torque,
            torque_most=torque_most,
            inertia=model.values[f"{name}.inertia"],
            stiffness=stiffness,
            output=output,
            noise=noise,
            sample_time=self.sample_time,
            duration=self.duration,
            dry=dry_level(model, name),
            angle=angle,
            turns=span / (2.0 * np.pi) if angle else 0.0,
            conditions={name: self._mean(condition_name((site, name), known)) for name in known},
        )

    def _mean(self, condition: str) -> float:
        """Mean of a measured condition over all records."""
        seen = [d.conditions[condition].at(d.time) for d in self.estimation.data if d.conditions is not None]
        return float(np.mean(np.concatenate(seen)))

    @cached_property
    def _torques(self) -> dict[str, tuple[float, float, float]]:
        """Stiffness, typical and largest torque of every coupling, in a free run of the linear part."""
        engine = CachingEngine(self.model)
        linear, layout = engine.linearise(None), engine.layout(None)
        stiffness, damping = layout.axis.stiffness, layout.axis.damping
        n, joints = len(linear.A) // 2, list(layout.joint_of.values())
        carried = np.zeros((len(joints), 2 * n))
        for row, joint in zip(carried, joints, strict=True):
            row[[joint, joint + 1]] = stiffness[joint], -stiffness[joint]
            row[[n + joint, n + joint + 1]] = damping[joint], -damping[joint]
        driven = np.block([[linear.A, linear.B[:, None]], [np.zeros((1, 2 * n + 1))]])
        found = []
        for d in self.estimation.data:
            transition, _ = discretise(driven, np.zeros_like(driven), d.sample_time)
            a, b = np.ascontiguousarray(transition[:-1, :-1]), np.ascontiguousarray(transition[:-1, -1:])
            nothing = np.zeros((len(joints), 1))
            found.append(respond(a, b, carried, nothing, np.zeros(2 * n), d.held_input()[:, None]))
        sizes = {}
        for (site, joint), torque in zip(layout.joint_of.items(), np.concatenate(found).T, strict=True):
            seen = torque[np.isfinite(torque)]
            typical, most = np.sqrt(np.sum(seen**2) / max(len(seen), 1)), np.max(np.abs(seen), initial=0.0)
            stiff, typical, most = (max(float(size), _LEAST) for size in (stiffness[joint], typical, most))
            sizes[site] = stiff, typical, most
        return sizes


def _finite(values: Array) -> Array:
    return np.asarray(values[np.isfinite(values)])


def _speed(data: Data, column: int) -> Array:
    known = np.isfinite(data.output[:, column])
    if np.sum(known) < 50:
        return np.zeros(0)
    return smooth_velocity(data.time[known], data.output[known, column])


def dry_level(model: Model, body: str) -> float:
    """Dry friction that a model has at a body at speed, 0 without any."""
    return sum(_values_as(model, body, lambda effect: effect.dry_level))


def command_limit(model: Model) -> float:
    """Command from which on a model cuts it at rest, infinite without such a limit."""
    return min(_values_as(model, INPUT, lambda effect: effect.command_limit), default=float("inf"))


def _values_as(model: Model, at: str, fact: Callable[[Effect], str]) -> Iterator[float]:
    """Values of the parameters at a site that a fact is about."""
    for active in model.effects:
        if active.at == at:
            name = parameter_as(active.effect, fact, *model.effect_folders)
            if name:
                yield values_of(active, model.values)[name]
