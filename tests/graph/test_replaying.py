"""What is refused before a graph starts."""

from pathlib import Path

import numpy as np
import pytest

from idloop.errors import InputError
from idloop.graph import Windows, replay_bag
from idloop.physics import load_model, simulate
from idloop.records import Record, write_bag


def test_a_bag_too_short_for_a_fit_is_refused_with_the_options_to_change(tmp_path: Path) -> None:
    time = np.arange(0.0, 5.0, 0.01)
    command = np.sign(np.sin(time))
    model = load_model("dc_motor")
    output = simulate(model, time, command, time).output
    units = tuple(one.unit for one in model.outputs)
    record = Record("run", time, command, time, output, "motor.effort", "V", model.output_names, units)
    bag = write_bag(tmp_path / "bag", record)
    with pytest.raises(InputError, match=r"too short .* shorten --window and --validation"):
        replay_bag(bag, "dc_motor", tmp_path / "out", windows=Windows(20.0, 10.0, 10.0))
