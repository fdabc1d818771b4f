"""A planar arm of two joints with a tool behind a fixed joint, and records of its inverse dynamics."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np
import pytest

# The optional extra `robot`.
collect_ignore_glob = [] if importlib.util.find_spec("pinocchio") else ["test_*.py"]

URDF = """<?xml version="1.0"?>
<!-- two links -->
<robot name="planar">
  <link name="base"/>
  <joint name="shoulder" type="revolute">
    <parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" velocity="3" effort="20"/>
  </joint>
  <link name="upper"><inertial><origin xyz="0 0 0.2"/><mass value="1.5"/>
    <inertia ixx="0.02" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.002"/></inertial></link>
  <joint name="elbow" type="continuous">
    <parent link="upper"/><child link="lower"/><origin xyz="0 0 0.4"/><axis xyz="0 1 0"/>
    <limit velocity="3" effort="10"/>
  </joint>
  <link name="lower"><inertial><origin xyz="0 0 0.15"/><mass value="0.8"/>
    <inertia ixx="0.006" ixy="0" ixz="0" iyy="0.006" iyz="0" izz="0.001"/></inertial></link>
  <joint name="flange" type="fixed"><parent link="lower"/><child link="tool"/><origin xyz="0 0 0.3"/></joint>
  <link name="tool"><inertial><mass value="0.2"/>
    <inertia ixx="1e-4" ixy="0" ixz="0" iyy="1e-4" iyz="0" izz="1e-4"/></inertial></link>
</robot>
"""
JOINTS = ("shoulder", "elbow")
VISCOUS, DRY, ARMATURE = np.array([0.4, 0.2]), np.array([0.5, 0.3]), np.array([0.05, 0.02])


@pytest.fixture(scope="session")
def urdf(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("robot") / "planar.urdf"
    path.write_text(URDF)
    return path


@pytest.fixture(scope="session")
def true_links(urdf) -> np.ndarray:
    """Inertial parameters of the machine: those of its description, scaled by links."""
    from idloop.robots.rigid_body import RigidBody

    return RigidBody(urdf).nominal * np.repeat([1.25, 0.85], 10)


def made(urdf, links, *, seed=0, duration=12.0, rate=200.0, noise=0.01, extra=None, offset=0.0):
    """Record of a sum of sines: efforts by Newton-Euler with friction, and those of a further effect."""
    from idloop.robots.joint_records import JointRecord
    from idloop.robots.rigid_body import RigidBody

    robot = RigidBody(urdf)
    random = np.random.default_rng(seed)
    time = np.arange(0.0, duration, 1.0 / rate)
    q, v, a = (np.zeros((len(time), 2)) for _ in range(3))
    for joint in range(2):
        for order in (1, 2, 3, 5):
            w, size, phase = 0.25 * 2 * np.pi * order, random.uniform(0.3, 0.7) / order, random.uniform(-3, 3)
            q[:, joint] += size * np.sin(w * time + phase)
            v[:, joint] += size * w * np.cos(w * time + phase)
            a[:, joint] -= size * w**2 * np.sin(w * time + phase)
    effort = robot.torque(links, q, v, a) + ARMATURE * a + VISCOUS * v + DRY * np.sign(v) + offset
    if extra is not None:
        effort += extra(q, v)
    effort += noise * random.normal(size=effort.shape)
    position = q + 2e-5 * random.normal(size=q.shape)
    return JointRecord(f"seed{seed}", JOINTS, time, position, v + 1e-3 * random.normal(size=v.shape), effort)
