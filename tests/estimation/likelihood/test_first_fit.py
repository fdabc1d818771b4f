"""`fit`, `diagnose` and `refine` begin with the same values."""

import numpy as np
import pytest
from tests.diagnosis.conftest import record_of

from idloop.diagnosis import diagnose, refine
from idloop.estimation import fit
from idloop.estimation.likelihood.estimation_problem import prepare_estimation
from idloop.physics import load_model


@pytest.mark.slow
@pytest.mark.parametrize("factor", [1.0, 0.7])
def test_fit_and_the_first_rung_agree_to_the_last_digit(factor: float) -> None:
    machine = load_model("axis")
    record = record_of(machine, 1, seconds=10.0, disturbance=0.02)
    start = machine.with_values({name: factor * machine.values[name] for name in machine.free})
    fitted = fit(start, [record])
    ladder, found = refine(start, [record], most=0), diagnose(start, [record])
    assert fitted.criterion == ladder.criterion == found.criterion == "prediction"
    assert {name: ladder.steps[0].model.values[name] for name in start.free} == dict(
        zip(fitted.names, fitted.values, strict=True)
    )
    assert found.model.values == ladder.steps[0].model.values


def test_a_problem_is_subsampled_by_segments_of_its_records() -> None:
    machine = load_model("axis")
    records = [record_of(machine, seed, seconds=10.0, name=f"run {seed}") for seed in (1, 2)]
    estimation = prepare_estimation(machine, records, "prediction")
    total = sum(len(one.time) for one in estimation.data)
    some = estimation.subsampled(total // 5)
    assert estimation.subsampled(total) is estimation
    assert sum(len(one.time) for one in some.data) == pytest.approx(total / 5, rel=0.01)
    for segment, record in zip(some.data, some.records, strict=True):
        whole = next(one for one in estimation.data if one.name == segment.name)
        place = np.searchsorted(whole.time, segment.time)
        np.testing.assert_array_equal(whole.output[place], segment.output)
        np.testing.assert_array_equal(whole.held_input()[place], segment.held_input())
        np.testing.assert_array_equal(record.time, segment.time)
