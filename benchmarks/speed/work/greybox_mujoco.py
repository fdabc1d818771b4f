"""MuJoCo's sysid: gear and damping of a hinge, its own Gauss-Newton with finite differences."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np
from absl import logging
from mujoco import sysid

logging.set_verbosity(logging.ERROR)

DOCUMENT = """
<mujoco>
  <option timestep="{step}" gravity="0 0 0" integrator="RK4"><flag contact="disable"/></option>
  <worldbody>
    <body>
      <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/><joint name="motor" type="hinge" axis="0 0 1" damping="1"/>
    </body>
  </worldbody>
  <actuator><motor name="drive" joint="motor" gear="1"/></actuator>
  <sensor><jointpos name="position" joint="motor"/><jointvel name="velocity" joint="motor"/></sensor>
</mujoco>
"""


def _set_gear(spec: Any, parameter: Any) -> None:
    gear = np.array(spec.actuator("drive").gear)
    gear[0] = parameter.value[0]
    spec.actuator("drive").gear = gear


def _set_damping(spec: Any, parameter: Any) -> None:
    damping = np.array(spec.joint("motor").damping, dtype=float)
    if damping.ndim:
        damping[0] = parameter.value[0]
    spec.joint("motor").damping = damping if damping.ndim else parameter.value[0]


def work(data: dict[str, Any], settings: dict[str, Any]) -> Callable[[], dict[str, Any]]:
    """Gain and viscous friction from the start that all contestants have."""
    spec = mujoco.MjSpec.from_string(DOCUMENT.format(step=settings["period"]))
    model = spec.compile()
    state = mujoco.MjData(model)
    stamps = np.arange(len(data["command"])) * settings["period"]
    control = sysid.TimeSeries(stamps, data["command"][:, None])
    sensors = sysid.TimeSeries.from_names(stamps[1:], data["output"][1:], model)
    start = sysid.create_initial_state(model, state.qpos, state.qvel, state.act)
    weights = dict(zip(("position", "velocity"), 1.0 / data["deviations"] ** 2, strict=True))

    def act() -> dict[str, Any]:
        parameters = sysid.ParameterDict()
        for name, modifier in (("gain", _set_gear), ("viscous", _set_damping)):
            parameters.add(
                sysid.Parameter(name, nominal=settings["start"][name], min_value=0.1, max_value=50.0, modifier=modifier)
            )
        sequences = sysid.ModelSequences("motor", spec, "measured", start, control, sensors)
        residual = sysid.build_residual_fn(models_sequences=[sequences], sensor_weights=weights)
        with contextlib.redirect_stdout(io.StringIO()):
            found, _ = sysid.optimize(
                initial_params=parameters, residual_fn=residual, optimizer="mujoco", verbose=False
            )
        return {name: found[name].value[0] for name in settings["names"]}

    return act
