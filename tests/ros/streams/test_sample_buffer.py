"""Records cut from what the estimator has seen, and which of them a diagnosis rests on."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")

from idloop.physics import load_model
from idloop.records.bags.cdr import SECOND
from idloop_nodes.streams.sample_buffer import DiagnosisData, SampleBuffer

MODEL = load_model("dc_motor")
STEP = SECOND // 100
START = 5 * SECOND


def buffer(seconds, reference=False):
    one = SampleBuffer(2)
    one.first = START
    for index in range(round(seconds * 100)):
        stamp = START + index * STEP
        one.commands.append(stamp, (float(index),))
        one.outputs.append(stamp, (index + 0.5, 1.0))
        if reference:
            one.announce(stamp, (index + 0.25, 0.0))
    return one


def spans(data):
    return [((a - START) / SECOND, (b - START) / SECOND) for a, b in data.spans]


def test_a_record_has_its_own_time_and_the_command_that_holds():
    record = buffer(4).record(MODEL, START + SECOND // 2, START + SECOND)
    assert record.time[0] == 0.0
    assert record.time.size == 50
    assert record.start_ns == START + SECOND // 2
    assert record.input_at(record.time).tolist() == list(range(50, 100))
    assert record.reference is None


def test_a_record_holds_the_reference_as_announced_last():
    one = buffer(4, reference=True)
    for index in range(80, 120):
        one.announce(START + index * STEP, (-1.0, 0.0))
    record = one.record(MODEL, START, START + SECOND)
    assert record.reference[:80, 0].tolist() == [index + 0.25 for index in range(80)]
    assert set(record.reference[80:, 0]) == {-1.0}
    assert record.reference_time[-1] == pytest.approx(0.99)


def test_a_diagnosis_rests_on_the_newest_stretch_and_is_judged_on_its_end():
    data = DiagnosisData()
    assert data.renew(buffer(60), MODEL, START + 60 * SECOND, 40 * SECOND, 0.25, 20)
    assert spans(data) == [(20.0, 60.0)]
    assert data.records[0].time.size == 3000
    assert data.validation[0].time.size == 1000
    assert np.array_equal(data.records[0].output[:, 0], np.arange(2000, 5000) + 0.5)


def test_experiments_come_beside_the_stretch_before_them():
    one, data = buffer(100), DiagnosisData()
    data.renew(one, MODEL, START + 40 * SECOND, 40 * SECOND, 0.25, 20)
    assert data.add_experiment(one, MODEL, (START + 45 * SECOND, START + 55 * SECOND), 0.25, 20)
    data.renew(one, MODEL, START + 55 * SECOND, 40 * SECOND, 0.25, 20)
    assert spans(data) == [(0.0, 40.0), (45.0, 55.0)]
    assert [len(record.time) for record in data.records] == [3000, 750]
    data.renew(one, MODEL, START + 90 * SECOND, 40 * SECOND, 0.25, 20)
    assert spans(data) == [(55.0, 90.0), (45.0, 55.0)], "the new stretch is nearly as long as the old one"
    assert data.experiments == 1


def test_only_the_newest_experiments_are_kept():
    one, data = buffer(100), DiagnosisData()
    for start in range(0, 60, 10):
        data.add_experiment(one, MODEL, (START + start * SECOND, START + (start + 5) * SECOND), 0.25, 20)
    assert spans(data) == [(20.0, 25.0), (30.0, 35.0), (40.0, 45.0), (50.0, 55.0)]


def test_too_little_data_is_no_data():
    one, data = buffer(1), DiagnosisData()
    assert not data.renew(SampleBuffer(2), MODEL, START, SECOND, 0.25, 20)
    assert not data.renew(one, MODEL, START + SECOND // 10, SECOND, 0.25, 20)
    assert not data.add_experiment(one, MODEL, (START, START + SECOND // 10), 0.25, 20)
    assert not data.add_experiment(one, MODEL, (START + 9 * SECOND, START + 8 * SECOND), 0.25, 20)
    assert data.records == ()
    assert data.renew(one, MODEL, START + SECOND, SECOND, 0.25, 20)
    data.clear()
    assert data.spans == ()


def test_a_velocity_once_seen_to_be_computed_stays_so_in_windows_that_cannot_show_it():
    random = np.random.default_rng(0)
    position = np.round(np.cumsum(np.repeat(random.normal(size=40), 20)), 1)
    one = SampleBuffer(2)
    one.first = START
    for index, (here, before) in enumerate(zip(position, [0.0, *position[:-1]], strict=True)):
        stamp = START + index * STEP
        one.commands.append(stamp, (float(index),))
        one.outputs.append(stamp, (float(here), float(here - before) / 0.01))
    short = (START + SECOND, START + 2 * SECOND, START + 2 * SECOND + STEP * 30)
    assert [record.findings for record in one.split(MODEL, *short)] == [(), ()]
    fitted, judge = one.split(MODEL, START, START + 6 * SECOND, START + 8 * SECOND)
    assert [found.where for found in fitted.findings] == ["motor.velocity"]
    assert judge.findings == fitted.findings == one.computed
    assert all(record.findings == one.computed for record in one.split(MODEL, *short))
    one.clear()
    assert all(record.findings for record in one.split(MODEL, *short)), "the sensors are the same after a reset"
