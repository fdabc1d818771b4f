from dataclasses import replace

import numpy as np
import pytest

from idloop.estimation import fit
from idloop.estimation.dataset import opening_segments, prepare


def test_an_opening_is_the_first_part_of_a_record(motor, experiment):
    whole = prepare(motor, [experiment(motor, samples=9000), experiment(motor, samples=16000, seed=1)])
    for part, d in zip(opening_segments(whole), whole, strict=True):
        count = len(d.time) // 8
        assert np.array_equal(part.time, d.time[:count])
        assert np.array_equal(part.output, d.output[:count])
        # Every command that acts on what is left, and none that comes later.
        assert np.array_equal(part.held_input(), d.held_input()[:count])
        assert part.input_time[-1] <= part.time[-1]


def test_short_or_unexcited_records_have_no_opening(motor, experiment):
    record = experiment(motor, samples=9000)
    quiet = replace(record, input=np.where(record.input_time < 30.0, 0.0, record.input))
    assert opening_segments(prepare(motor, [record])) is not None
    assert opening_segments(prepare(motor, [record, experiment(motor, samples=7000)])) is None
    assert opening_segments(prepare(motor, [record, quiet])) is None
    silent = record.output.copy()
    silent[:2000] = np.nan
    assert opening_segments(prepare(motor, [replace(record, output=silent)])) is None


def computed(motor, experiment, **changes):
    """A record whose driver has no more than an encoder."""
    record = experiment(motor, **changes)
    position = np.round(record.output[:, 0], 2)
    velocity = np.gradient(position, record.time)
    return replace(record, output=np.column_stack([position, velocity]))


def test_a_velocity_computed_from_the_position_is_no_second_sensor(motor, experiment):
    record, own = computed(motor, experiment), experiment(motor, seed=1)
    (data,) = prepare(motor, [record])
    assert np.all(np.isnan(data.output[:, 1]))
    assert np.array_equal(data.output[:, 0], record.output[:, 0])
    assert np.all(np.isfinite(record.output)), "the record stays as it is"
    (kept,) = prepare(motor, [record], keep_computed=True)
    assert np.array_equal(kept.output, record.output)
    # Whichever record shows it, the sensors are the same in all.
    for several in ([own, record], [record, own]):
        assert all(np.all(np.isnan(one.output[:, 1])) for one in prepare(motor, several))
    assert np.all(np.isnan(prepare(motor, [own], companions=[record])[0].output[:, 1]))
    assert np.all(np.isfinite(prepare(motor, [own])[0].output))


def test_a_computed_velocity_is_used_without_its_position(motor, experiment):
    record = computed(motor, experiment)
    speed_only = record.output.copy()
    speed_only[:, 0] = np.nan
    (_, data) = prepare(motor, [record, replace(record, output=speed_only)])
    assert np.array_equal(data.output[:, 1], record.output[:, 1])


@pytest.mark.slow
def test_a_fit_beside_a_computed_velocity_is_that_of_the_position(motor, experiment):
    record = computed(motor, experiment)
    alone = record.output.copy()
    alone[:, 1] = np.nan
    beside, without = fit(motor, [record]), fit(motor, [replace(record, output=alone)])
    assert np.array_equal(beside.values, without.values)
    assert np.array_equal(beside.stderr, without.stderr)
