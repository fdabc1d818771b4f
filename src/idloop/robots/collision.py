"""Self-collision of a robot, from the primitives and meshes of its URDF, by Pinocchio and Coal."""

from __future__ import annotations

from typing import Any

import numpy as np

from idloop.arrays import Array
from idloop.robots.rigid_body import RigidBody, load_pinocchio


class SelfCollision:
    """Distances between the links of a robot that could meet.

    Pairs of neighbours, and pairs that overlap in the zero position, are left out.

    `problem`: why nothing is checked; empty where it is.
    """

    def __init__(self, robot: RigidBody) -> None:
        pinocchio = load_pinocchio()
        self._pin: Any = pinocchio
        self._robot = robot
        self.problem = ""
        self._model: Any = robot.pinocchio_model()
        self._data: Any = self._model.createData()
        try:
            geometry = pinocchio.buildGeomFromUrdf(
                self._model, str(robot.path), pinocchio.GeometryType.COLLISION, package_dirs=[str(robot.path.parent)]
            )
        except (ValueError, RuntimeError) as error:
            self.problem = f"self-collision is not checked: {' '.join(str(error).split())}"
            self._count = 0
            return
        geometry.addAllCollisionPairs()
        shapes, parents = geometry.geometryObjects, self._model.parents
        for pair in list(geometry.collisionPairs):
            a, b = shapes[pair.first].parentJoint, shapes[pair.second].parentJoint
            if a == b or parents[a] == b or parents[b] == a:
                geometry.removeCollisionPair(pair)
        self._geometry: Any = geometry
        self._shapes: Any = pinocchio.GeometryData(geometry)
        apart = self._distances(np.zeros(len(robot.joints)))
        for pair, distance in zip(list(geometry.collisionPairs), apart, strict=True):
            if distance <= 0.0:
                geometry.removeCollisionPair(pair)
        self._shapes = pinocchio.GeometryData(geometry)
        self._count = len(geometry.collisionPairs)
        if not self._count:
            self.problem = "self-collision is not checked: the URDF has no collision geometry of links that could meet"

    def least_distance(self, position: Array) -> Array:
        """Least distance of any pair of links at joint positions (n, joints), shape (n,) [m]; negative: they overlap.

        Infinite where nothing is checked.
        """
        if not self._count:
            return np.full(len(position), np.inf)
        return np.array([min(self._distances(one)) for one in position])

    def _distances(self, position: Array) -> list[float]:
        q = self._robot.configuration(position)
        self._pin.computeDistances(self._model, self._data, self._geometry, self._shapes, q)
        return [float(one.min_distance) for one in self._shapes.distanceResults]
