"""What the gate says of the data is what a comparison says of them."""

import numpy as np
import pytest

from idloop.diagnose.gate import _reversals
from idloop.estimate.dataset import prepare
from idloop.physics import load_model
from idloop.records import Record
from idloop.validate.doing import doing_of
from idloop.validate.regions import since_reversal

TIME = np.arange(0.0, 10.0, 1e-3)


@pytest.mark.parametrize("hidden", [None, 0, 1])
@pytest.mark.parametrize("small", [0.0, 0.006])
def test_reversals_are_counted_as_a_comparison_counts_them(hidden: int | None, small: float) -> None:
    random = np.random.default_rng(0)
    w = 0.4 * np.pi
    # A motion that turns every 2.5 s, and swings of less than a hundredth of its range that turn it oftener.
    position = -np.cos(w * TIME) / w + small * np.sin(5.0 * np.pi * TIME)
    output = np.column_stack([position, np.gradient(position, TIME)]) + random.normal(size=(TIME.size, 2)) * [
        1e-5,
        1e-3,
    ]
    if hidden is not None:
        output[:, hidden] = np.nan
    model = load_model("dc_motor")
    units = tuple(one.unit for one in model.outputs)
    record = Record("r", TIME, np.sin(TIME), TIME, output, model.input.name, "V", model.output_names, units)
    (data,) = prepare(model, [record])
    direction = doing_of(model, data, "motor").direction
    assert direction is not None
    counted = len(since_reversal(data.time, direction)[1])
    assert _reversals(model, data) == counted
    assert (counted == 3) == (small == 0.0)
