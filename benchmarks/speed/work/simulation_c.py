"""Free run by plain C, compiled with -O3 by gcc."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np


def compiled(bodies: int) -> Any:
    """Function of chain.c for so many bodies."""
    with tempfile.TemporaryDirectory() as folder:
        library = Path(folder) / "chain.so"
        source = Path(__file__).with_name("chain.c")
        compiler = shutil.which("gcc")
        if compiler is None:
            raise ImportError("gcc", name="gcc: apt install gcc")
        command = [compiler, "-O3", f"-DN={bodies}", "-shared", "-fPIC", "-o", str(library), str(source), "-lm"]
        subprocess.run(command, check=True)
        return ctypes.CDLL(str(library)).simulate


def work(data: dict[str, Any], settings: dict[str, Any]) -> Callable[[], dict[str, Any]]:
    """Positions at each sample, ``settings["pieces"]`` steps a sample."""
    bodies = len(data["inertia"])
    run = compiled(bodies)
    numbers = [data[key] for key in ("inertia", "viscous", "dry", "stiffness", "damping", "gain")]
    chain = np.ascontiguousarray(np.concatenate(numbers))
    command = np.ascontiguousarray(data["command"])
    double = ctypes.POINTER(ctypes.c_double)

    def act() -> dict[str, Any]:
        output = np.empty((len(command), 2 * bodies))
        run(
            chain.ctypes.data_as(double), command.ctypes.data_as(double), ctypes.c_int(len(command)),
            ctypes.c_double(settings["period"]), ctypes.c_int(settings["pieces"]), output.ctypes.data_as(double),
        )  # fmt: skip
        return {"position": output[:, :bodies]}

    return act
