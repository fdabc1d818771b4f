"""How the compiled simulator is compiled."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from idloop.physics import Engine, kernel, load_model


def test_every_model_carries_the_address_of_the_one_integrator():
    address = kernel.address_of_advance()
    for name in ("dc_motor", "torsion"):
        assert int(Engine(load_model(name)).layout().axis.constants[kernel.ADVANCE]) == address > 0


@pytest.mark.parametrize("name", ["simulate", "predict"])
def test_what_calls_the_integrator_is_compiled_without_it(name: str):
    engine, time = Engine(load_model("dc_motor")), 0.01 * np.arange(5)
    measured = engine.simulate(None, time, np.ones(5), time)
    engine.predict(None, time, np.ones(5), time, measured, np.zeros((3, 2)))
    function = getattr(kernel, name)
    line, folder = function.py_func.__code__.co_firstlineno, Path(function.stats.cache_path)
    (code,) = folder.glob(f"kernel.{name}-{line}.py{sys.version_info[0]}{sys.version_info[1]}.1.nbc")
    assert f"kernel{len(name)}{name}".encode() in code.read_bytes()
    assert b"kernel7advance" not in code.read_bytes()
