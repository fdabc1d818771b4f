"""Records cut where nothing was measured for long."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from idloop.errors import InputError
from idloop.physics import load_model
from idloop.records import Record, check_identifiable, check_record, cut_at_gaps, read_records, usable_parts, write_bag
from idloop.records.gaps import FEWEST, LEFT_OUT, LONGEST_GAP, LONGEST_GAP_SAMPLES

YEAR = 365.25 * 86_400.0


def record(time, output=None, command=None):
    time = np.asarray(time, dtype=float)
    output = np.sin(time) if output is None else output
    command = np.cos(time) if command is None else command
    return Record("run", time, command, time, output[:, None], "motor.effort", "V", ("motor.position",), ("rad",))


def with_gaps(step, counts, gaps):
    """Stamps of parts of so many samples, with so many seconds between them."""
    steps = [step] * (counts[0] - 1)
    for count, gap in zip(counts[1:], gaps, strict=True):
        steps += [gap] + [step] * (count - 1)
    return np.concatenate([[0.0], np.cumsum(steps)])


@pytest.mark.parametrize("step", [0.001, 0.1])
def test_a_gap_on_both_sides_of_the_bound(step):
    bound = max(LONGEST_GAP, LONGEST_GAP_SAMPLES * step)
    whole = record(with_gaps(step, (200, 200), [0.999 * bound]))
    assert cut_at_gaps(whole) == [whole]
    first, second = cut_at_gaps(record(with_gaps(step, (200, 200), [1.001 * bound])))
    assert (first.time.size, second.time.size) == (200, 200)
    assert second.time[0] == pytest.approx(199 * step + 1.001 * bound), "time is kept"
    assert (first.name, second.name) == ("run", "run(2)")
    (finding,) = [one for one in first.findings if one.kind == "gap"]
    assert finding.level == "warning"
    assert "2 of 2 parts are used" in finding.text
    assert not second.findings


def test_a_part_of_a_few_samples_is_left_out():
    parts = cut_at_gaps(record(with_gaps(0.01, (200, FEWEST - 1, 200, FEWEST), [5.0, 5.0, 5.0])))
    assert [part.time.size for part in parts] == [200, 200, FEWEST]
    assert "3 of 4 parts are used" in parts[0].findings[0].text


def test_many_gaps_are_one_line():
    parts = cut_at_gaps(record(with_gaps(0.01, (20,) * 50, [5.0] * 49)))
    assert len(parts) == 50
    assert "and 46 more" in parts[0].findings[0].text


@pytest.mark.parametrize("count", [0, 1, 2, 9])
def test_what_is_too_short_stays_as_it_is(count):
    whole = record(100.0 * np.arange(count))
    assert cut_at_gaps(whole) == [whole]


@pytest.mark.parametrize("still", [[0], [2], [0, 1], [0, 1, 2]])
def test_parts_that_no_fit_can_use_are_left_out_and_named(still):
    time = with_gaps(0.01, (200, 200, 200), [5.0, 5.0])
    output = np.sin(time)
    for part in still:
        output[200 * part : 200 * (part + 1)] = 1.0
    parts = cut_at_gaps(record(time, output))
    if len(still) == 3:
        with pytest.raises(InputError, match="run: nothing moves"):
            usable_parts(parts, check_identifiable)
        return
    kept = usable_parts(parts, check_identifiable)
    assert [one.name for one in kept] == [one.name for k, one in enumerate(parts) if k not in still]
    assert [one.kind for one in kept[0].findings] == ["gap", LEFT_OUT]
    assert f"of 3 parts between gaps {'one is' if len(still) == 1 else '2 are'} left out" in kept[0].findings[-1].text
    assert f"{parts[still[-1]].name}: nothing moves" in kept[0].findings[-1].text
    assert usable_parts(parts, lambda one: one) == parts


def test_recordings_of_their_own_are_no_parts():
    time = np.arange(0.0, 2.0, 0.01)
    still = replace(record(time, np.ones(time.size)), name="run(2)")
    with pytest.raises(InputError, match=r"run\(2\): nothing moves"):
        usable_parts([record(time), still], check_identifiable)


@given(
    counts=st.lists(st.integers(1, 40), min_size=2, max_size=8),
    gaps=st.lists(st.floats(0.001, 100.0), min_size=7, max_size=7),
)
def test_no_sample_is_changed_and_no_part_has_a_long_gap(counts, gaps):
    whole = record(with_gaps(0.001, counts, gaps[: len(counts) - 1]))
    parts = cut_at_gaps(whole)
    kept = np.concatenate([part.time for part in parts])
    assert np.isin(kept, whole.time).all()
    assert np.all(np.diff(kept) > 0.0)
    for part in parts:
        if len(parts) > 1:
            assert np.all(np.diff(part.time) <= LONGEST_GAP)
            assert part.time.size >= FEWEST
        np.testing.assert_array_equal(part.output[:, 0], np.sin(part.time))
        np.testing.assert_array_equal(part.input_at(part.time), whole.input_at(part.time))


@pytest.mark.parametrize("gap", [3600.0, 10 * YEAR])
def test_a_bag_with_a_gap_is_several_records(tmp_path, gap):
    model = load_model("dc_motor")
    time = with_gaps(0.01, (300, 300), [gap])
    motion = np.column_stack([np.sin(np.arange(600) / 30.0), np.cos(np.arange(600) / 30.0)])
    names, units = ("motor.position", "motor.velocity"), ("rad", "rad/s")
    command = np.sign(np.sin(np.arange(600) / 7.0))
    write_bag(tmp_path / "bag", Record("bag", time, command, time, motion, "motor.effort", "V", names, units))
    first, second = read_records(tmp_path / "bag", model)
    assert (first.time.size, second.time.size) == (300, 300)
    assert first.duration + second.duration < 6.0


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda y: 1e300 * y, "no measurement is above 1e"),
        (lambda y: 1e-310 * y, "varies by only .*; check its unit"),
        (lambda y: y + 1e15, "subtract its offset"),
        (lambda y: y + 1e13, "subtract its offset"),
    ],
)
@pytest.mark.parametrize("signal", ["output", "command"])
def test_numbers_that_no_double_can_compute_with_are_refused(change, said, signal):
    time = 0.01 * np.arange(200)
    with pytest.raises(InputError, match=said):
        check_record(record(time, **{signal: change(np.sin(7.0 * time))}))


@pytest.mark.parametrize("change", [lambda y: 1e49 * y, lambda y: 1e-49 * y, lambda y: y + 1e10, lambda y: 0.0 * y])
def test_numbers_that_a_double_can_compute_with_are_taken(change):
    time = 0.01 * np.arange(200)
    check_record(record(time, change(np.sin(7.0 * time))))
