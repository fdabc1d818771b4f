"""A log that is faster than its sensor: what it repeats was not measured, and fits see only what is new."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import idloop
from idloop.records.inspection.checks import check_record
from idloop.records.inspection.faults.checks import inspect_axis
from idloop.records.inspection.repeats import repeats, without_repeats


@pytest.fixture(scope="module")
def record():
    """An axis with the inertia 0.01 kg·m² and the viscous friction 0.05 N·m·s/rad."""
    signal = idloop.excitation("multilevel", sample_time=0.002, duration=10.0, amplitude=0.5, seed=3)
    return idloop.simulate(idloop.load_model("axis"), signal, seed=3)


def _held(values, every):
    return values[np.arange(len(values)) // every * every]


def test_only_new_values_are_kept(record):
    place = record.output[:, 0]
    assert without_repeats(place) is place
    found = without_repeats(_held(place, 5))
    np.testing.assert_array_equal(np.flatnonzero(np.isfinite(found)), np.arange(0, place.size, 5))


def test_a_standstill_is_measured_as_often_as_a_motion(record):
    place = np.concatenate([record.output[:, 0], np.full(1000, 1e3)])
    assert np.isfinite(without_repeats(_held(place, 4))[-1000:]).sum() == pytest.approx(250, abs=2)


def test_a_fit_is_right_although_the_log_repeats_every_value(record):
    repeated = check_record(replace(record, output=_held(record.output, 5)))
    assert repeated.time.size == pytest.approx(record.time.size / 5, abs=2)
    assert [one.kind for one in repeated.findings if one.kind == "repeated_samples"]
    found = idloop.fit(idloop.load_model("axis"), [repeated]).values
    assert found["axis.inertia"] == pytest.approx(0.01, rel=0.05)
    assert found["axis.viscous_friction"] == pytest.approx(0.05, rel=0.1)


def test_repeats_do_not_turn_the_command(make_axis):
    axis = make_axis(rate=1000.0, count=8000)
    kinds = [one.kind for one in inspect_axis(replace(axis, position=_held(axis.position, 4), velocity=None))]
    assert kinds == ["repeated_samples"]


@pytest.mark.parametrize("share", [0.002, 0.01])
def test_a_slow_motion_on_steps_of_the_sensor_repeats_nothing_where_a_level_comes_in_several_last_digits(share):
    angle = np.sin(0.006 * np.arange(4000))
    coarse = np.round(angle / (2.0 * share)) * 2.0 * share
    coarse[::397] = np.nextafter(coarse[::397], np.inf)
    assert repeats(coarse)[0].size == 0
