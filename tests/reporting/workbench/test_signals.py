"""The page's buffers: bounded, in order, and a record of what they hold."""

from __future__ import annotations

import numpy as np
import pytest

from idloop.physics import load_model
from idloop.reporting.workbench.ring import SPARE
from idloop.reporting.workbench.signals import STREAMS, Signals

MS = 1_000_000


@pytest.fixture
def signals():
    return Signals(load_model("dc_motor"), capacity=5000)


def fill(signals, count, start=10**9):
    stamps = start + MS * np.arange(count)
    rows = np.column_stack([np.arange(count), -np.arange(count)]).astype(float)
    signals.extend("measured", stamps, rows)
    signals.extend("residual", stamps, 0.01 * rows)
    signals.extend("command", stamps[::10], np.ones((len(stamps[::10]), 1)))


def test_memory_is_bounded_however_long_it_runs(signals):
    before = signals.nbytes
    for part in range(6):
        fill(signals, 4000, 10**9 + part * 4000 * MS)
    assert signals.nbytes == before
    start, stop = signals.span
    assert (start, stop) == pytest.approx((19.0, 23.999))
    view = signals.view(start, stop, 100)
    assert set(view.points) == set(STREAMS)
    assert all(len(time) <= 2 * 104 for time, _ in view.points.values())


def test_what_is_only_drawn_takes_half_the_memory_and_a_record_is_exact(signals):
    stamps, measured, drawn = 7 * 8, 2 * 8 + 8, (4 * 2 + 1) * 4
    assert signals.nbytes == (5000 + 5000 // SPARE) * (stamps + measured + drawn)
    model, fine = load_model("dc_motor"), np.full((10, 2), 100.0 + 1e-9)
    signals.extend("command", 10**9 + MS * np.arange(10), fine[:, :1])
    signals.extend("measured", 10**9 + MS * np.arange(10), fine)
    record = signals.record(model, 10**9, 2 * 10**9)
    assert np.array_equal(record.output, fine)
    assert np.array_equal(record.input, fine[:, 0])


def test_a_view_keeps_the_command_to_the_newest_measurement(signals):
    fill(signals, 1000)
    time, values = signals.view(0.0, 2.0, 500).points["command"]
    assert time[-1] == pytest.approx(0.999)
    assert values[-1] == 1.0


def test_the_band_is_that_of_the_sensor_and_else_of_the_bulk_of_the_residual(signals):
    fill(signals, 1000)
    assert signals.view(0.0, 1.0, 100).band == pytest.approx([1.959964 * 0.0332, 1.959964 * 0.0728])
    signals.noise[:] = np.nan
    rng = np.random.default_rng(1)
    residual = rng.normal(0.0, 0.2, (1000, 2))
    residual[::50] = 100.0  # bursts must not hide themselves
    signals.replace("residual", 10**9 + MS * np.arange(1000), residual)
    assert signals.view(0.0, 1.0, 100).band == pytest.approx([0.392, 0.392], rel=0.2)


def test_a_residual_below_the_stated_noise_refutes_it(signals):
    fill(signals, 1000)
    rng = np.random.default_rng(2)
    residual = np.column_stack([rng.normal(0.0, 0.002, 1000), rng.normal(0.0, 0.0728, 1000)])
    signals.replace("residual", 10**9 + MS * np.arange(1000), residual)
    assert signals.view(0.0, 1.0, 100).band == pytest.approx([1.959964 * 0.002, 1.959964 * 0.0728], rel=0.1)
    # A few samples, or none of which anything is left, say nothing.
    assert signals.view(0.0, 0.05, 100).band == pytest.approx([1.959964 * 0.0332, 1.959964 * 0.0728])
    signals.replace("residual", 10**9 + MS * np.arange(1000), 0.0 * residual)
    assert signals.view(0.0, 1.0, 100).band == pytest.approx([1.959964 * 0.0332, 1.959964 * 0.0728])


def test_a_clock_that_is_set_back_begins_anew(signals):
    fill(signals, 3000)
    fill(signals, 10)
    assert signals.runs == 1
    assert signals.span == pytest.approx((0.0, 0.009))


def test_a_record_of_a_stretch_has_the_times_of_the_page(signals):
    fill(signals, 1000)
    model = load_model("dc_motor")
    record = signals.record(model, signals.stamp(0.2), signals.stamp(0.5))
    assert record.time[[0, -1]] == pytest.approx([0.2, 0.499])
    assert record.output[0].tolist() == [200.0, -200.0]
    assert record.input_time[0] <= record.time[0]
    assert record.absolute(record.time)[0] == signals.stamp(0.2)
