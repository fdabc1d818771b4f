"""A velocity that is none of the recorded position is told, and no other; records go on without it."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from idloop.records import Finding, check_identifiable, inspect_bag, read_record, read_records, write_bag
from idloop.records.inspection.velocity_check import KIND, velocity_slope, without_wrong_velocities, wrong_velocities
from idloop.records.tables.importing import import_bag

RANDOM = np.random.default_rng(5)
UNITS = {"motor.position": "rad", "motor.velocity": "rad/s"}


@pytest.fixture
def axis():
    """Time, position and velocity of twenty seconds of random steps into a lag, at 100 Hz."""
    time = np.arange(2000) / 100
    command = np.repeat(np.random.default_rng(1).normal(size=40), 50)
    velocity = np.convolve(command, np.exp(-np.arange(200) / 20) / 20)[:2000]
    return time, np.cumsum(velocity) * 1e-2, velocity


def said(time, position, velocity, units=UNITS, **more):
    found = wrong_velocities(time, {"motor.position": position, "motor.velocity": velocity}, units, **more)
    assert all(one.kind == KIND and one.where == "motor.velocity" and one.level == "warning" for one in found)
    return " ".join(one.text for one in found)


@pytest.mark.parametrize(
    ("factor", "unit"), [(30 / np.pi, "rpm"), (180 / np.pi, "deg/s"), (0.5 / np.pi, "rev/s"), (1e3, "mrad/s")]
)
def test_a_velocity_in_another_unit_is_told_with_the_unit_that_mends_it(axis, factor, unit):
    time, position, velocity = axis
    assert f"unit: {unit}" in said(time, position, factor * velocity)


def test_a_velocity_of_a_sledge_is_told_in_units_of_length(axis):
    time, position, velocity = axis
    units = {"motor.position": "m", "motor.velocity": "m/s"}
    assert "unit: mm/s" in said(time, position, 1e3 * velocity, units)


@pytest.mark.parametrize(
    ("factor", "options"),
    [
        (np.pi / 180, ["--position COLUMN=deg", "--velocity COLUMN=rad/s"]),
        (2 * np.pi, ["--position COLUMN=rev", "--velocity COLUMN=rad/s"]),
        (1e3, ["--time COLUMN=ms", "--velocity COLUMN=mrad/s"]),
        (1e6, ["--time COLUMN=us"]),
        (30 / np.pi, ["--velocity COLUMN=rpm"]),
    ],
)
def test_the_options_name_first_what_a_velocity_that_was_read_in_rad_s_leaves(axis, factor, options):
    time, position, velocity = axis
    assert re.findall(r"--\w+ COLUMN=[\w/]+", said(time, position, factor * velocity)) == options


@pytest.mark.parametrize(
    ("factor", "options"),
    [
        (1e3, ["--velocity COLUMN=mm/s", "--time COLUMN=ms"]),
        (1e-3, ["--position COLUMN=mm", "--time COLUMN=s"]),
    ],
)
def test_the_options_of_a_sledge_are_in_units_of_length(axis, factor, options):
    time, position, velocity = axis
    text = said(time, position, factor * velocity, {"motor.position": "m", "motor.velocity": "m/s"})
    assert re.findall(r"--\w+ COLUMN=[\w/]+", text) == options


def test_a_turned_sign_a_dead_column_and_noise_are_told_apart(axis):
    time, position, velocity = axis
    assert "scale: -1" in said(time, position, -velocity)
    assert "stays at 0" in said(time, position, 0.0 * velocity)
    assert "unrelated" in said(time, position, np.std(velocity) * RANDOM.normal(size=time.size))
    assert "unrelated" in said(time, position, 3.0 * position)
    assert "2.5" in said(time, position, 2.5 * velocity)


@pytest.mark.parametrize("seed", range(5))
def test_a_noisy_coarse_late_or_biased_velocity_is_not_told(axis, seed):
    time, position, velocity = axis
    random = np.random.default_rng(seed)
    size = float(np.std(velocity))
    assert not said(time, position, velocity + size * random.normal(size=time.size))
    assert not said(time, position, size * np.trunc(velocity / size))
    assert not said(time, position, np.interp(time - 0.1, time, velocity))
    assert not said(time, position, velocity + random.uniform(-1, 1) * size)
    counts = 0.01 * np.round(position / 0.01)
    assert not said(time, counts, np.concatenate([[0.0], np.diff(counts) / 0.01]))


@pytest.mark.parametrize("factor", [1.1, 0.9, 1.07])
def test_a_scale_that_is_a_little_off_is_told_from_noise_and_a_filter(axis, factor):
    time, position, velocity = axis
    random = np.random.default_rng(3)
    noisy = velocity + 0.02 * np.std(velocity) * random.normal(size=time.size)
    late = lfilter([0.2], [1.0, -0.8], noisy)  # 40 ms
    twice = lfilter([0.3], [1.0, -0.7], late)
    for measured in (noisy, late, twice, np.interp(time - 0.05, time, velocity)):
        assert not said(time, position, measured)
        text = said(time, position, factor * measured)
        assert f"`scale:` in the mapping by {1.0 / factor:.1f}" in text
    # Rounded towards zero, it is too small by half a step.
    step = 0.3 * np.std(velocity)
    assert not said(time, position, step * np.trunc(velocity / step))


def test_an_axis_that_hardly_moves_says_nothing_of_its_velocity():
    time = np.arange(2000) / 100
    for position in (1e-3 * RANDOM.normal(size=2000), 1e-3 * RANDOM.integers(0, 2, size=2000)):
        assert velocity_slope(time, position, np.zeros(2000)) is None
    assert velocity_slope(time[:40], np.sin(time[:40]), np.zeros(40)) is None


def test_a_constant_velocity_beside_even_motion_is_one():
    time = np.arange(2000) / 100
    assert not said(time, 0.7 * time, np.full(2000, 0.7))
    assert said(time, 0.7 * time, np.full(2000, 7.0))


def test_wraps_glitches_holes_and_stamps_of_their_own_do_not_matter(axis):
    time, position, velocity = axis
    turned = np.mod(20.0 * position, 2 * np.pi)
    assert not said(time, turned, 20.0 * velocity)
    assert "rpm" in said(time, turned, 20.0 * 30 / np.pi * velocity)
    spoilt = position.copy()
    spoilt[[300, 900, 1500]] = 1e3
    assert not said(time, spoilt, velocity)
    cut = np.concatenate([np.arange(600), np.arange(900, 2000)])
    assert not said(time[cut], position[cut], velocity[cut])
    apart = [np.where(np.arange(2000) % 2 == k, column, np.nan) for k, column in enumerate((position, velocity))]
    assert not said(time, *apart)
    assert "scale: -1" in said(time, apart[0], -apart[1])


def test_a_tachometer_in_volts_has_no_slope_to_be_judged_by_and_a_scale_of_the_model_counts(axis):
    time, position, velocity = axis
    assert not said(time, position, 0.1 * velocity, {"motor.position": "rad", "motor.velocity": "V"})
    assert not said(time, position, 0.1 * velocity, scales={"motor.velocity": 0.1})


def test_each_joint_is_looked_at(axis):
    time, position, velocity = axis
    columns = {"a.position": position, "a.velocity": velocity, "b.position": position, "b.velocity": -velocity}
    assert [one.where for one in wrong_velocities(time, columns, {})] == ["b.velocity"]


def turned(record):
    return replace(record, output=record.output * [1.0, -1.0])


def test_a_record_is_read_without_a_wrong_velocity_by_all_who_fit(tmp_path, model, record):
    bag = write_bag(tmp_path / "turned", turned(record))
    for read in (read_record(bag, model), *read_records([bag], model)):
        assert [one.kind for one in read.findings if one.level == "warning"] == [KIND]
        assert np.isnan(read.output[:, 1]).all()
        assert np.isfinite(read.output[:, 0]).all()
        assert check_identifiable(read) is read


def test_a_record_in_which_nothing_can_be_told_follows_the_others(record):
    short = record.cut(0.0, 0.05)
    wrong, left = without_wrong_velocities([turned(record), turned(short)])
    assert np.isnan(wrong.output[:, 1]).all()
    assert np.isnan(left.output[:, 1]).all()
    good, kept = without_wrong_velocities([record, short])
    assert good is record
    assert kept is short
    one_wrong = without_wrong_velocities([turned(record), record])
    assert [bool(np.isnan(one.output[:, 1]).all()) for one in one_wrong] == [True, False]
    (known,) = without_wrong_velocities([short], known=[Finding(KIND, "", where="motor.velocity")])
    assert np.isnan(known.output[:, 1]).all()


def test_inspection_says_what_fits_will_go_on_without(tmp_path, record):
    assert inspect_bag(write_bag(tmp_path / "good", record)).left_out == ()
    inspection = inspect_bag(write_bag(tmp_path / "turned", turned(record)))
    assert inspection.left_out == ("motor.velocity",)
    assert KIND in [one.kind for one in inspection.findings]
    assert inspection.verdict == "usable"


def test_a_velocity_of_a_slow_repeating_sensor_keeps_its_place(data_dir, tmp_path):
    """The slope alone is 1.1 ± 0.05; beside a delay it would be 1.65, as the sensor repeats its values."""
    folder = data_dir / "failing_inputs" / "05_start_values"
    if not folder.is_dir():
        pytest.skip(f"no {folder}: set IDLOOP_DATA to the folder of the measured data")
    import_bag(folder / "openarm_j5.csv", tmp_path / "bag", folder / "openarm.yaml")
    assert KIND not in {one.kind for one in inspect_bag(tmp_path / "bag").findings}
