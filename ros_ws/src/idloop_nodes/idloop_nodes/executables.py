"""The scripts: one function for each executable."""

from __future__ import annotations

import sys

from idloop_nodes.runtime import run


def excitation() -> None:
    """Run the excitation node."""
    sys.exit(run("excitation"))


def controller() -> None:
    """Run the controller node."""
    sys.exit(run("controller"))


def bridge() -> None:
    """Run the bridge to a robot."""
    sys.exit(run("bridge"))


def guardian() -> None:
    """Run the guardian of the bridge."""
    sys.exit(run("guardian"))


def plant() -> None:
    """Run the simulated plant."""
    sys.exit(run("plant"))


def mujoco_plant() -> None:
    """Run the plant that MuJoCo moves."""
    sys.exit(run("mujoco_plant"))


def recorder() -> None:
    """Run the recorder."""
    sys.exit(run("recorder"))


def estimator() -> None:
    """Run the estimator."""
    sys.exit(run("estimator"))


def replay() -> None:
    """Run the replay node."""
    sys.exit(run("replay"))


def workbench() -> None:
    """Run the workbench."""
    sys.exit(run("workbench"))
