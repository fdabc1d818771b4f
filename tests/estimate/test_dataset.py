from dataclasses import replace

import numpy as np

from idloop.estimate.dataset import openings, prepare


def test_an_opening_is_the_first_part_of_a_record(motor, experiment):
    whole = prepare(motor, [experiment(motor, samples=9000), experiment(motor, samples=16000, seed=1)])
    for part, d in zip(openings(whole), whole, strict=True):
        count = len(d.time) // 8
        assert np.array_equal(part.time, d.time[:count])
        assert np.array_equal(part.output, d.output[:count])
        # Every command that acts on what is left, and none that comes later.
        assert np.array_equal(part.held_input(), d.held_input()[:count])
        assert part.input_time[-1] <= part.time[-1]


def test_short_or_unexcited_records_have_no_opening(motor, experiment):
    record = experiment(motor, samples=9000)
    quiet = replace(record, input=np.where(record.input_time < 30.0, 0.0, record.input))
    assert openings(prepare(motor, [record])) is not None
    assert openings(prepare(motor, [record, experiment(motor, samples=7000)])) is None
    assert openings(prepare(motor, [record, quiet])) is None
    silent = record.output.copy()
    silent[:2000] = np.nan
    assert openings(prepare(motor, [replace(record, output=silent)])) is None
