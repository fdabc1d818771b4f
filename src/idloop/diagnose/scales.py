"""Typical sizes of a set of records at a site of a model, from which effects choose what to try."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from idloop.diagnose.proposals import command_limit, dry_level
from idloop.estimate.dataset import Data
from idloop.estimate.engine import RememberingEngine
from idloop.estimate.likelihood.setting import Setting
from idloop.estimate.linear.propagate import respond
from idloop.estimate.observer import discretise
from idloop.physics.conditions import condition_name
from idloop.physics.effect import BODY, COUPLING, OUTPUT
from idloop.physics.model import Model
from idloop.physics.trial import Scales
from idloop.validate.regions import smooth_velocity

Array = NDArray[np.float64]


class Sizes:
    """Sizes of motion, forces and outputs, found once for all sites.

    Parameters
    ----------
    model : Model
        Model fitted to the records.
    setting : Setting
    """

    def __init__(self, model: Model, setting: Setting) -> None:
        self.model, self.setting = model, setting
        command = np.concatenate([d.input for d in setting.data])
        self.command = max(float(np.sqrt(np.mean(command**2))), 1e-12)
        self.command_most = max(float(np.max(np.abs(command))), 1e-12)
        self.duration = float(sum(d.time[-1] - d.time[0] for d in setting.data))
        self.sample_time = float(np.median([d.sample_time for d in setting.data]))
        self.bodies = [self._motion(body) for body in model.bodies]

    def _motion(self, body: str) -> tuple[float, float, float, float]:
        """Speed rms and maximum, middle and span of the positions of a body, or of its nearest neighbour."""
        order = sorted(self.model.bodies, key=lambda other: abs(self._index(other) - self._index(body)))
        for other in order:
            outputs = [(i, o) for i, o in enumerate(self.model.outputs) if o.body == other and self._measured(i)]
            positions = [(i, o.scale) for i, o in outputs if o.field == "position"]
            velocities = [(i, o.scale) for i, o in outputs if o.field == "velocity"]
            if not positions and not velocities:
                continue
            speeds, places = [], []
            for d in self.setting.data:
                if velocities:
                    speeds.append(_finite(d.output[:, velocities[0][0]]) / velocities[0][1])
                else:
                    speeds.append(_speed(d, positions[0][0]) / positions[0][1])
                if positions:
                    places.append(_finite(d.output[:, positions[0][0]]) / positions[0][1])
                else:
                    places.append(np.cumsum(speeds[-1]) * d.sample_time)
            speed, place = np.concatenate(speeds), np.concatenate(places)
            if len(speed) == 0 or len(place) == 0:
                continue
            span = max(float(np.ptp(place)), 1e-12)
            rms = max(float(np.sqrt(np.mean(speed**2))), 1e-9 * span / self.sample_time, 1e-12)
            most = max(float(np.percentile(np.abs(speed), 99.5)), rms)
            return rms, most, float(0.5 * (np.min(place) + np.max(place))), span
        return 1.0, 1.0, 0.0, 1.0

    def _measured(self, column: int) -> bool:
        return any(np.any(np.isfinite(d.output[:, column])) for d in self.setting.data)

    def _index(self, body: str) -> int:
        return self.model.bodies.index(body)

    def at(self, kind: str, site: str) -> Scales:
        """Sizes at one site."""
        model, values = self.model, self.model.values
        body = 0
        output = noise = 1.0
        twist = torque = torque_most = stiffness = 1.0
        if kind == BODY:
            body = self._index(site)
        elif kind == OUTPUT:
            place = next(i for i, o in enumerate(model.outputs) if o.site == site)
            body = self._index(model.outputs[place].body)
            seen = np.concatenate([_finite(d.output[:, place]) for d in self.setting.data])
            output = max(float(np.sqrt(np.mean(seen**2))), 1e-12) if len(seen) else 1.0
            noise = float(self.setting.noise[place])
        elif kind == COUPLING:
            inner = model.inner_couplings.get(site)
            body = model.couplings.index(site) + 1 if inner is None else self._index(inner.at)
            stiffness, torque, torque_most = self._torques[site]
            twist = torque / stiffness
        speed, most, middle, span = self.bodies[body]
        name = model.bodies[body]
        known = self.setting.conditions
        angle = model.units.position == "rad"
        return Scales(
            command=self.command,
            command_most=self.command_most,
            limit=command_limit(model),
            force=self.setting.force,
            speed=speed,
            speed_most=most,
            middle=middle,
            span=span,
            twist=twist,
            torque=torque,
            torque_most=torque_most,
            inertia=values[f"{name}.inertia"],
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
        seen = [d.conditions[condition].at(d.time) for d in self.setting.data if d.conditions is not None]
        return float(np.mean(np.concatenate(seen)))

    @cached_property
    def _torques(self) -> dict[str, tuple[float, float, float]]:
        """Stiffness, typical and largest torque of every coupling, in a free run of the linear part."""
        engine = RememberingEngine(self.model)
        linear = engine.linearise(None)
        layout = engine.layout(None)
        stiffness, damping = layout.axis.stiffness, layout.axis.damping
        n = len(linear.A) // 2
        joints = list(layout.joint_of.values())
        carried = np.zeros((len(joints), 2 * n))
        for row, joint in zip(carried, joints, strict=True):
            row[joint], row[joint + 1] = stiffness[joint], -stiffness[joint]
            row[n + joint], row[n + joint + 1] = damping[joint], -damping[joint]
        nothing = np.zeros((len(joints), 1))
        found = []
        for d in self.setting.data:
            transition, _ = discretise(
                np.block([[linear.A, linear.B[:, None]], [np.zeros((1, 2 * n + 1))]]),
                np.zeros((2 * n + 1, 2 * n + 1)),
                d.sample_time,
            )
            a, b = np.ascontiguousarray(transition[:-1, :-1]), np.ascontiguousarray(transition[:-1, -1:])
            found.append(respond(a, b, carried, nothing, np.zeros(2 * n), d.held_input()[:, None]))
        sizes = {}
        for (site, joint), torque in zip(layout.joint_of.items(), np.concatenate(found).T, strict=True):
            seen = torque[np.isfinite(torque)]
            typical, most = np.sqrt(np.sum(seen**2) / max(len(seen), 1)), np.max(np.abs(seen), initial=0.0)
            stiff, typical, most = (max(float(size), 1e-12) for size in (stiffness[joint], typical, most))
            sizes[site] = stiff, typical, most
        return sizes


def _finite(values: Array) -> Array:
    return np.asarray(values[np.isfinite(values)])


def _speed(data: Data, column: int) -> Array:
    known = np.isfinite(data.output[:, column])
    if np.sum(known) < 50:
        return np.zeros(0)
    return smooth_velocity(data.time[known], data.output[known, column])
