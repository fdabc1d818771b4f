"""What the methods of a record keep: time, the held command, the mean, the shape of NaN."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from idloop.errors import InputError

ONCE = settings(suppress_health_check=[HealthCheck.function_scoped_fixture])


@ONCE
@given(start=st.floats(0.0, 0.9), length=st.floats(0.1, 1.0))
def test_cut_keeps_time_and_the_command_in_force(record, start, length):
    part = record.cut(start, start + length)
    assert part.time[0] >= start
    assert part.time[-1] <= start + length
    np.testing.assert_array_equal(part.input_at(part.time), record.input_at(part.time))
    assert part.start_ns == record.start_ns
    assert part.reference is not None
    assert part.reference_time is not None
    assert part.reference_time[0] <= part.time[0]


@pytest.mark.parametrize("name", ["reference", "excitation"])
def test_a_single_column_in_place_of_two_is_said_in_one_line(record, name):
    column = getattr(record, name)[:, 0]
    with pytest.raises(InputError, match=rf"{name} \({column.size},\) must be \(samples, 2\)"):
        replace(record, **{name: column})


def test_drop_is_a_cut_from_both_ends(record):
    part = record.drop(0.5, 0.25)
    assert part.time[0] == pytest.approx(0.5)
    assert part.time[-1] == pytest.approx(1.999 - 0.25)
    with pytest.raises(InputError, match="nothing left"):
        record.drop(1.5, 1.5)
    with pytest.raises(InputError, match="negative"):
        record.drop(-1.0)


@ONCE
@given(edges=st.lists(st.floats(0.0, 3.0), min_size=2, max_size=20, unique_by=lambda x: round(x, 4)))
def test_mean_command_is_the_integral_of_the_held_one(record, edges):
    edges = np.sort(np.array(edges))
    fine = np.linspace(edges[0], edges[-1], 40_001)
    middle = 0.5 * (fine[1:] + fine[:-1])
    area = record.input_mean(edges) @ np.diff(edges)
    assert area == pytest.approx(np.sum(record.input_at(middle) * np.diff(fine)), abs=2e-3)


def test_decimation_keeps_every_kth_sample_of_each_sensor(record):
    output = record.output.copy()
    output[1::2, 1] = np.nan
    mixed = replace(record, output=output)
    thin = mixed.decimate(10, antialias=False)
    assert np.isfinite(thin.output).sum(axis=0).tolist() == [200, 100]
    np.testing.assert_array_equal(thin.output[np.isfinite(thin.output[:, 1]), 1], output[::20, 1])
    assert thin.input is record.input
    smooth = record.decimate(10)
    np.testing.assert_allclose(smooth.output[20:-20], record.output[::10][20:-20], atol=0.06)
    assert record.decimate(1) is record
    with pytest.raises(InputError, match="whole number"):
        record.decimate(0)


def test_resampling_onto_a_grid(record):
    keep = np.sort(np.random.default_rng(0).choice(2000, 1500, replace=False))
    keep[0], keep[-1] = 0, 1999
    irregular = replace(record, time=record.time[keep], output=record.output[keep])
    grid = irregular.resample(0.002)
    np.testing.assert_allclose(np.diff(grid.time), 0.002, atol=1e-12)
    assert np.isfinite(grid.output).all()
    np.testing.assert_allclose(grid.output[:, 0], np.interp(grid.time, record.time, record.output[:, 0]), atol=3e-4)
    hole = replace(record, output=np.where((record.time > 0.5) & (record.time < 0.7), np.nan, record.output.T).T)
    refilled = hole.resample(0.001, antialias=False)
    assert np.isnan(refilled.output[(refilled.time > 0.51) & (refilled.time < 0.69)]).all()
    with pytest.raises(InputError, match="sample period"):
        record.resample(0.0)


@pytest.mark.parametrize(("kind", "degree"), [("mean", 0), ("linear", 1)])
def test_detrend_removes_what_it_says(record, kind, degree):
    plain = record.detrend(kind)
    for time, values in ((plain.time, plain.output), (plain.input_time, plain.input)):
        assert np.abs(np.polynomial.polynomial.polyfit(time, values, degree)).max() < 1e-9
    with pytest.raises(InputError, match="did you mean 'linear'"):
        record.detrend("liner")


def test_filter_of_command_and_outputs_keeps_their_relation(record):
    both = record.filtered(None, 20.0, inputs=True)
    assert both.input.shape == both.input_time.shape == both.time.shape
    assert np.std(np.diff(both.input)) < 0.5 * np.std(np.diff(record.input_at(record.time)))
    assert both.findings[-1].kind == "processing"
    assert record.filtered(None, 20.0).input is record.input


def test_shapes_and_order_are_checked(record):
    with pytest.raises(InputError, match="one length"):
        replace(record, input=record.input[1:])
    with pytest.raises(InputError, match="must be"):
        replace(record, output=record.output[:, :1])
    with pytest.raises(InputError, match="increase strictly"):
        replace(record, time=record.time[::-1])
    with pytest.raises(InputError, match="units"):
        replace(record, output_units=("rad",))
    with pytest.raises(InputError, match=r"did you mean 'motor\.position'"):
        record.column("motor.positon")
