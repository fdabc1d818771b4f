"""Refits of single effects: what the noise model may take for its own."""

import numpy as np
import pytest

from idloop.diagnose.confirm import _without_long_memory
from idloop.diagnose.refit import LONG_MEMORY, refit
from idloop.diagnose.setting import prepare_setting
from idloop.physics import Model, load_model

from .conftest import record_of


@pytest.mark.parametrize(("offset", "least", "most"), [(0.1, 15.0, np.inf), (0.0, -0.1, 4.0)])
def test_a_constant_force_is_found_behind_a_walk(start: Model, offset: float, least: float, most: float) -> None:
    # Ten samples of memory disturb this run; a walk does as well as long as it may stand for the offset too.
    machine = load_model("axis").with_effects([f"input_offset@input(offset={offset})"])
    setting = prepare_setting(start, [record_of(machine, 1, seconds=6.0, disturbance=0.02)], "prediction")
    parent = refit(setting, start)
    found = refit(setting, parent.model.with_effects(["input_offset@input"]), None, parent, rounds=1)
    better = _without_long_memory(setting, parent, found)
    assert least < better.log_likelihood - parent.log_likelihood < most
    if offset:
        assert parent.criterion.memory >= LONG_MEMORY
        assert found.log_likelihood - parent.log_likelihood < 1.0
        assert better.criterion.memory < LONG_MEMORY
        assert better.model.values["input_offset@input.offset"] == pytest.approx(offset, rel=0.1)
