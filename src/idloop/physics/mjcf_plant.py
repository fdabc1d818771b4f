"""A joint of an MJCF file as a machine, simulated by MuJoCo, with the sensors of a model."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from idloop.arrays import Array
from idloop.errors import InputError
from idloop.physics.model import Model, OutputSignal
from idloop.spelling import did_you_mean


class MjcfPlant:
    """Simulate an MJCF file as `idloop.physics.Plant` does a model: commands in, noisy measurements out.

    The model defines outputs, units and noise; the motion is MuJoCo's. An output is the MJCF sensor of its name where
    there is one, otherwise the position or velocity of its joint.

    `file`: MJCF file; included files are found beside it.
    `model`: model of the outputs, with their scale and noise; its bodies and effects are not used.
    `sample_time`: sample time [s]; MuJoCo's own step is shortened where it does not divide it.
    `joints`: MJCF joint by joint of the model, where the names differ.
    `actuator`: MJCF actuator that takes the command; empty: the only one.
    `seed`: seed of the measurement noise.
    `noise`: add the measurement noise of the model's outputs.
    Raises InputError: MuJoCo is not installed, the file is not valid MJCF, or it has no such joint or actuator.
    """

    def __init__(
        self,
        file: Path,
        model: Model,
        sample_time: float,
        *,
        joints: Mapping[str, str] | None = None,
        actuator: str = "",
        seed: int = 0,
        noise: bool = True,
    ) -> None:
        try:
            import mujoco
        except ImportError as error:
            raise InputError("MuJoCo is not installed: pip install mujoco") from error
        self._mujoco: Any = mujoco
        # Errors are raised here; MuJoCo would write a log file in the working directory.
        mujoco.set_mju_user_warning(lambda text: None)
        self.model = model
        self._file = file
        if not file.is_file():
            raise InputError(f"{file}: no such MJCF file: check the path")
        try:
            self._machine: Any = mujoco.MjModel.from_xml_path(str(file))
        except ValueError as error:
            raise InputError(f"{file}: MuJoCo refuses it: {' '.join(str(error).split())}") from error
        steps = max(1, math.ceil(sample_time / self._machine.opt.timestep - 1e-6))
        self._machine.opt.timestep = sample_time / steps
        self._data: Any = mujoco.MjData(self._machine)
        self._actuator = self._find_actuator(actuator)
        self._sources = [self._source(one, joints or {}) for one in model.outputs]
        self._scale = np.array([one.scale for one in model.outputs])
        self._noise_std = np.array([(one.noise or 0.0) if noise else 0.0 for one in model.outputs])
        self._random = np.random.default_rng(seed)
        self.reset()

    @property
    def step_time(self) -> float:
        """Length of MuJoCo's own steps [s]."""
        return float(self._machine.opt.timestep)

    @property
    def time(self) -> float:
        """Time now [s]."""
        return float(self._data.time)

    def reset(self) -> None:
        """Return to the file's initial state and time 0; the random generator is not reset."""
        self._mujoco.mj_resetData(self._machine, self._data)
        self._mujoco.mj_forward(self._machine, self._data)
        self._steps = 0
        self._waiting: list[tuple[float, float]] = []

    def measure(self) -> Array:
        """Read the sensors now, with noise (p,)."""
        # After a step sensors and positions are those at its beginning until the next forward computation.
        self._mujoco.mj_forward(self._machine, self._data)
        clean = np.array([float(values[index]) for values, index in self._sources])
        return np.asarray(self._scale * clean + self._noise_std * self._random.standard_normal(len(clean)))

    def schedule(self, stamp: float, command: float) -> None:
        """Apply a command from ``stamp`` [s] on, rounded to MuJoCo's steps, or from now when that is past.

        Raises InputError: the command is not finite.
        """
        if not math.isfinite(command):
            raise InputError(f"command at {stamp:g} s is not finite")
        if self._waiting:
            stamp = max(stamp, self._waiting[-1][0])
        self._waiting.append((stamp, command))

    def advance(self, until: float) -> None:
        """Run to a time [s]. Raises InputError: MuJoCo's simulation has become unstable."""
        length = self.step_time
        end = round(until / length)
        while self._steps < end:
            # Rounded to the nearest step.
            while self._waiting and self._waiting[0][0] <= (self._steps + 0.5) * length:
                self._data.ctrl[self._actuator] = self._waiting.pop(0)[1]
            # All steps up to the next command in one call.
            following = end if not self._waiting else math.ceil(self._waiting[0][0] / length - 0.5)
            count = min(max(following - self._steps, 1), end - self._steps)
            self._mujoco.mj_step(self._machine, self._data, count)
            self._steps += count
        refused = self._data.warning[self._mujoco.mjtWarning.mjWARN_BADQACC].number
        if refused or not np.all(np.isfinite(self._data.qpos)):
            raise InputError(f"{self._file}: the simulation became unstable: shorten its timestep ({length:g} s)")

    def step(self, command: float, until: float) -> None:
        """Apply a command from now on and run to ``until`` [s]."""
        self.schedule(self._steps * self.step_time, command)
        self.advance(until)

    def _names(self, kind: str) -> list[str]:
        count = getattr(self._machine, {"joint": "njnt", "actuator": "nu", "sensor": "nsensor"}[kind])
        return [getattr(self._machine, kind)(index).name for index in range(count)]

    def _find_actuator(self, name: str) -> int:
        known = self._names("actuator")
        if name in known:
            return known.index(name)
        if name or len(known) != 1:
            there = ", ".join(known) or "none"
            raise InputError(f"{self._file}: no actuator {name!r}{did_you_mean(name, known)}; name one of: {there}")
        return 0

    def _source(self, output: OutputSignal, joints: Mapping[str, str]) -> tuple[Any, int]:
        """Array of MuJoCo's data and the index of an output in it."""
        if output.name in self._names("sensor"):
            return self._data.sensordata, int(self._machine.sensor_adr[self._machine.sensor(output.name).id])
        name = joints.get(output.joint, output.joint)
        known = self._names("joint")
        if name not in known:
            raise InputError(
                f"{self._file}: no sensor {output.name!r} and no joint {name!r}{did_you_mean(name, known)}; "
                f"joints: {', '.join(known) or 'none'}"
            )
        joint = self._machine.joint(name).id
        kinds = self._mujoco.mjtJoint
        if int(self._machine.jnt_type[joint]) not in (int(kinds.mjJNT_HINGE), int(kinds.mjJNT_SLIDE)):
            raise InputError(f"{self._file}: joint {name} is neither a hinge nor a slide")
        if output.field == "position":
            return self._data.qpos, int(self._machine.jnt_qposadr[joint])
        if output.field == "velocity":
            return self._data.qvel, int(self._machine.jnt_dofadr[joint])
        raise InputError(f"{self._file}: output {output.name}: only position and velocity of a joint are measured")
