"""Models that differ in their initial state only."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from idloop.diagnosis.equivalence.same_motion import same_motion, same_motion_from_another_place
from idloop.physics import load_model, simulate
from idloop.records import Record

TIME = np.arange(0.0, 4.0, 0.005)


def recorded(model):
    command = 0.4 * np.sign(np.sin(5.0 * TIME)) * np.abs(np.sin(1.3 * TIME))
    output = simulate(model, TIME, command, TIME).output + 1e-4 * np.random.default_rng(0).normal(size=(len(TIME), 1))
    return [Record("run", TIME, command, TIME, output, "axis.effort", "N·m", model.output_names, ("rad",))]


@pytest.mark.parametrize(("beside", "same"), [([], True), (["imbalance@axis(amplitude=0.1)"], False)])
def test_an_offset_of_a_position_is_another_start_unless_a_force_depends_on_the_position(beside, same):
    axis = load_model("axis")
    model = replace(axis, outputs=axis.outputs[:1]).with_effects(beside)
    offset = model.with_effects([f"sensor_offset@{model.outputs[0].site}(offset=1.0)"])
    records = recorded(offset)
    assert not same_motion(offset, model, records)
    assert same_motion_from_another_place(offset, model, records) is same
