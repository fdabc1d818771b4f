"""Free run by MuJoCo: hinges, a tendon as the spring, friction loss; its own rollout in C, no Python in the loop."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import mujoco
import mujoco.rollout
import numpy as np


def document(data: dict[str, Any], step: float, integrator: str) -> str:
    """MJCF of the chain."""
    bodies, tendons = "", ""
    for i, inertia in enumerate(data["inertia"]):
        bodies += (
            f'<body><inertial pos="0 0 0" mass="1" diaginertia="{inertia} {inertia} {inertia}"/>'
            f'<joint name="j{i}" type="hinge" axis="0 0 1" damping="{data["viscous"][i]}"'
            f' frictionloss="{data["dry"][i]}"/>'
            "</body>"
        )
        if i + 1 < len(data["inertia"]):
            tendons += (
                f'<fixed name="t{i}" stiffness="{data["stiffness"][i]}" damping="{data["damping"][i]}">'
                f'<joint joint="j{i}" coef="1"/><joint joint="j{i + 1}" coef="-1"/></fixed>'
            )
    tendons = f"<tendon>{tendons}</tendon>" if tendons else ""
    return (
        f'<mujoco><option timestep="{step}" gravity="0 0 0" integrator="{integrator}"><flag contact="disable"/>'
        f"</option><worldbody>{bodies}</worldbody>{tendons}"
        f'<actuator><motor joint="j0" gear="{data["gain"][0]}"/></actuator></mujoco>'
    )


def work(data: dict[str, Any], settings: dict[str, Any]) -> Callable[[], dict[str, Any]]:
    """Positions at each sample, ``settings["pieces"]`` steps a sample."""
    pieces, bodies = settings["pieces"], len(data["inertia"])
    model = mujoco.MjModel.from_xml_string(document(data, settings["period"] / pieces, settings["integrator"]))
    state = mujoco.MjData(model)
    size = mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    start = np.zeros((1, size))
    control = np.repeat(data["command"], pieces).reshape(1, -1, 1)

    def act() -> dict[str, Any]:
        states, _ = mujoco.rollout.rollout(model, state, start, control)
        # A state is time, positions, velocities; it stands after its step.
        after = states[0, pieces - 1 :: pieces, 1 : 1 + bodies]
        return {"position": np.vstack([np.zeros((1, bodies)), after[:-1]])}

    return act
