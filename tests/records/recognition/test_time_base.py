"""The stamps of a table: column, unit, period from the notes, runs."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from idloop.errors import InputError
from idloop.records.recognition.guess import Given
from idloop.records.recognition.mapping_file import mapping_of
from idloop.records.recognition.recognise import recognise_table
from idloop.records.recognition.table_column import numbers_of
from idloop.records.recognition.time_base import base_of_clock, doubt_of_decimation, find_time_base
from idloop.records.tables.mapping import parse_mapping
from idloop.records.tables.table import Table
from idloop.records.tables.table_files import read_table

K = np.arange(200.0)


def _base(columns, given=None, period=None, **table):
    held = Table("log.csv", {name: np.asarray(value) for name, value in columns.items()}, **table)
    return find_time_base(held, numbers_of(held), given, 200, period)


UNITS = {
    "decimals": (K * 0.005, "s", False),
    "whole numbers every 20": (20 * K, "ms", False),
    "whole numbers every 5": (5 * K, "ms", False),
    "whole numbers every 400, by microseconds or a slow log": (400 * K, "us", True),
    "whole numbers every 1100": (1100 * K, "us", True),
    "whole numbers every 60": (60 * K, "ms", True),
    "decimals every 0.12, by seconds or 8 kHz": (2.28 + 0.12005 * K, "s", True),
    "decimals every 1.001, by 1 kHz or a slow log": (33.185 + 1.001 * K, "ms", True),
    "decimals every 0.1": (0.1 * K, "s", False),
    "seconds since 1970": (1.7e9 + 0.01 * K, "s", False),
    "milliseconds since 1970": (1.7e12 + 10 * K, "ms", False),
    "nanoseconds since 1970": (1.7e18 + 1e7 * K, "ns", False),
}


@pytest.mark.parametrize("name", UNITS)
def test_units_that_are_not_written_down(name):
    value, unit, doubtful = UNITS[name]
    base = _base({"t": value, "u": np.sin(K)})
    assert base.time.column == "t"
    assert base.time.unit == unit
    assert bool(base.doubt) == doubtful


@pytest.mark.parametrize(("column", "unit"), [("time_ms", "ms"), ("Time [us]", "us"), ("elapsed (s)", "s")])
def test_a_unit_that_is_written_down_is_sure(column, unit):
    base = _base({column: 60 * K})
    assert (base.time.column, base.time.unit, base.doubt) == (column, unit, "")


def test_what_is_given_counts():
    assert _base({"a": K, "b": 3 * K}, Given("b", "us")).time.unit == "us"
    assert _base({"u": np.sin(K)}, period=0.002).time.period == 0.002
    with pytest.raises(InputError, match="not a unit of time"):
        _base({"a": K}, Given("a", "rad"))


@pytest.mark.parametrize(
    ("name", "value", "period"),
    [("Ts", 0.01, 0.01), ("config.dt", 0.002, 0.002), ("fs", 500.0, 0.002), ("config.action_hz", 50.0, 0.02),
     ("sample_rate", 1000.0, 0.001), ("axis/sample_rate", 1000.0, 0.001)],
)  # fmt: skip
def test_a_period_or_a_rate_beside_the_columns(name, value, period):
    base = _base({"u": np.sin(K)}, attributes={"gain": 3.0, name: value})
    assert base.time.period == pytest.approx(period)
    assert name in base.reason


def test_a_period_deep_in_a_file_is_of_something_else():
    with pytest.raises(InputError, match="no column is a time"):
        _base({"u": np.sin(K)}, attributes={"model.report.Ts": 0.015, "pwm_freq": 20e3})


def test_dates_that_the_file_gives_to_its_signals():
    dates = [f"2024-01-01T00:00:{0.1 * k:06.3f}" for k in range(200)]
    base = base_of_clock(Table("log.csv", {"t": dates}), "t", "", "")
    assert (base.time.column, base.time.unit) == ("t", "iso8601")
    np.testing.assert_allclose(np.diff(base.seconds), 0.1, atol=1e-6)


def test_a_column_without_a_name_that_rises_evenly_is_a_doubtful_time():
    base = _base({"0": np.sin(K), "1": 0.01 * K})
    assert base.time.column == "1"
    assert base.doubt


def test_dates_and_runs(tmp_path):
    path = tmp_path / "a.csv"
    rows = [f"2025-11-12T10:03:{second:02d}.5Z,{second}" for second in range(30)]
    path.write_text("when,u\n" + "\n".join(rows))
    table = read_table(path)
    base = find_time_base(table, numbers_of(table), Given("when"), 30, None)
    assert base.time.unit == "iso8601"
    assert np.diff(base.seconds) == pytest.approx(1.0)
    twice = np.concatenate([K[:120], K[:80], K[:3]])
    runs = find_time_base(t := Table(path, {"t": twice}), numbers_of(t), None, 203, None).runs
    assert [(one.start, one.stop) for one in runs] == [(0, 120), (120, 200)], "three rows are no run"


@pytest.mark.parametrize(
    ("line", "period"),
    [
        ("Sampling period [ms];1", 1e-3),
        ("sample rate: 2 kHz", 5e-4),
        ("dt = 0.004 s", 4e-3),
        ("Abtastzeit [us]: 250", 2.5e-4),
        ("Cycle time 62,5 us", 6.25e-5),
        ("SAMPLE_RATE=500", 2e-3),
        ("fs: 4000", 2.5e-4),
    ],
)
def test_a_period_that_the_notes_state(tmp_path, line, period):
    path = tmp_path / "a.csv"
    path.write_text(f"log of a drive\n{line}\nposition;current\n" + "".join(f"{k % 7};{k % 3}\n" for k in range(20)))
    table = read_table(path)
    base = find_time_base(table, numbers_of(table), None, 20, None)
    assert base.time.period == pytest.approx(period)


@pytest.mark.parametrize("name", ["tick", "ticks", "loop", ""])
@pytest.mark.parametrize(
    ("note", "period"),
    [
        ("1 tick = 0.5 ms", 5e-4),
        ("one tick is 0.002 s", 2e-3),
        ("Tick period [us];250", 2.5e-4),
        ("Timer resolution 100 us per tick", 1e-4),
        ("timer of 1 MHz / tick", 1e-6),
        ("# log of a drive\n# ticks at 10 kHz", 1e-4),
    ],
)
def test_a_counter_of_ticks_is_a_time_by_the_period_that_the_notes_state(tmp_path, name, note, period):
    path = tmp_path / "a.csv"
    rows = "".join(f"{8000 + 20 * k};{k % 7};{(k * k) % 11}\n" for k in range(40))
    path.write_text(f"{note}\n{name};current;phi\n{rows}")
    table = read_table(path)
    base = find_time_base(table, numbers_of(table), None, 40, None)
    np.testing.assert_allclose(np.diff(base.seconds), 20 * period)
    assert base.doubt == ""
    assert "the notes above the table say" in base.reason
    assert recognise_table(table).of("position").column == "phi"


@pytest.mark.parametrize(
    ("head", "first", "other"),
    [
        ("X,CH1,Start,Increment\nSequence,Volt,-1,2e-4\n", "{},1,,\n", "{},1,,\n"),
        ("X,CH1,Start,Increment\n", "{},1,-1,2e-4\n", "{},1,,\n"),
    ],
)
def test_an_increment_that_is_said_once(tmp_path, head, first, other):
    path = tmp_path / "a.csv"
    path.write_text(head + first.format(0) + "".join(other.format(k) for k in range(1, 30)))
    table = read_table(path)
    assert find_time_base(table, numbers_of(table), None, 30, None).time.period == 2e-4


def test_a_rate_that_disagrees_with_the_stamps_is_doubted():
    columns = {"t": 0.01 * K, "u": np.sin(K)}
    assert _base(columns, period=0.01).doubt == ""
    assert "'t' says every 0.01 s" in _base(columns, period=0.02).doubt
    assert _base({"t": 10 * K, "u": np.sin(K)}, period=0.01).doubt == "", "milliseconds"
    assert _base({"0": K, "u": np.sin(K)}, period=0.01).doubt == ""


def test_stamps_that_stand_still_are_doubted():
    assert "--rate HZ" in _base({"t [s]": np.floor(0.01 * K), "u": np.sin(K)}).doubt


@pytest.mark.parametrize(("name", "scale"), [("dt_us", 8000.0), ("dt [ms]", 8.0), ("loop time (s)", 0.008)])
@pytest.mark.parametrize("spread", [0.0, 0.002, 0.1])
def test_the_time_since_the_row_before_is_no_time_since_the_start(name, scale, spread):
    if name.startswith("loop") and not spread:
        return
    value = scale * (1.0 + spread * np.random.default_rng(1).uniform(-1.0, 1.0, 200))
    base = _base({name: value, "u": np.sin(K), "y": np.cos(K)})
    assert base.time.period == pytest.approx(0.008, rel=0.02)
    assert len(base.runs) == 1
    assert ("rows are taken as even" in base.doubt) == (spread > 0.01)


def test_stamps_that_stand_for_several_rows_count_in_a_plausible_unit(tmp_path):
    path = tmp_path / "console.log"
    path.write_text("".join(f"I ({1000 + 4 * k // 10 * 10}) ctl: duty={k % 7} pos={k * k % 11}\n" for k in range(300)))
    base = recognise_table(read_table(path)).base
    assert base.time.unit == "ms"
    assert "--rate HZ" in base.doubt


def test_a_time_that_cannot_be_read_is_shown(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("Time,u,y\n" + "".join(f"10:{k:02d},{k % 3},{k % 5}\n" for k in range(30)))
    table = read_table(path)
    with pytest.raises(InputError, match=r"'Time' is '10:00', neither numbers nor times such as 10:03:29.5"):
        find_time_base(table, numbers_of(table), None, 30, None)


def test_without_any_time_the_user_is_asked():
    with pytest.raises(InputError, match="--rate HZ or --period S"):
        _base({"u": np.sin(K), "y": np.cos(K)})


def test_stamps_of_a_signal_without_a_unit_are_in_a_plausible_one():
    table = Table("log.txt", {"u": K, "u.time": K, "y.time": 0.002 * K}, clocks={"u": "u.time"})
    base = base_of_clock(table, "u.time", "", "")
    assert (base.time.unit, base.doubt != "") == ("ms", True), "it may be 1 s as well"
    assert base_of_clock(table, "y.time", "", "").doubt == ""
    assert base_of_clock(table, "u.time", "us", "").time.unit == "us"
    assert base_of_clock(table, "u.time", "us", "s").time.unit == "s"
    with pytest.raises(InputError, match="not a unit of time"):
        base_of_clock(table, "u.time", "", "rad")


@pytest.mark.parametrize("period", [0.0, -1.0, np.inf, np.nan])
def test_a_period_that_is_none_is_refused(period):
    with pytest.raises(InputError, match="above zero and finite"):
        _base({"u": np.sin(K)}, period=period)


def test_a_nameless_time_that_starts_again_divides_the_runs():
    time = np.concatenate([0.01 * K[:90] + 7e-5, 0.01 * K[:70] + 2e-2, 0.01 * K[:40]])
    base = _base({"0": np.sign(np.sin(K)), "1": time + 2e-3 * np.sin(K) ** 2, "2": np.cos(0.1 * K)})
    assert base.time.column == "1"
    assert base.doubt
    assert [(one.start, one.stop) for one in base.runs] == [(0, 90), (90, 160), (160, 200)]


NONE = {
    "one row": ({"t": [0.0], "u": [1.0]}, "only 1 row of data"),
    "two rows": ({"t": [0.0, 0.1], "u": [1.0, 2.0]}, "only 2 rows of data"),
    "backwards": ({"t": -K, "u": np.sin(K)}, "'t' runs backwards: turn the order of the rows"),
    "backwards without a name": ({"0": -K, "1": np.sin(K)}, "'0' runs backwards"),
    "a time that stands": ({"t": 0 * K, "u": np.sin(K)}, "'t' is 0 in every row"),
    "no order": ({"t": np.mod(-K, 3.0), "u": np.sin(K)}, "'t' falls from row to row as often as it rises"),
    "none": ({"u": np.sin(K), "y": np.cos(K)}, r"no column is a time; .* \(columns are u, y\)"),
}


@pytest.mark.parametrize("name", NONE)
def test_why_no_column_is_a_time_is_said(name):
    columns, words = NONE[name]
    with pytest.raises(InputError, match=words):
        _base(columns)


def test_of_two_columns_that_rise_evenly_the_one_that_counts_the_rows_is_no_time():
    base = _base({"0": K, "1": np.round(0.002 * K, 4), "2": np.sin(K)})
    assert (base.time.column, base.time.unit) == ("1", "s")


@pytest.mark.parametrize(
    ("note", "factor", "doubtful"),
    [("Sample rate: 100 Hz", 1, False), ("Sample rate: 100 Hz", 10, True), ("Cycle time [ms];1", 1, True),
     ("Max. samples: 500", 10, False), ("Operator: Kim", 10, False)],
)  # fmt: skip
def test_rows_that_were_left_out_are_doubted(tmp_path, note, factor, doubtful):
    rows = "".join(f"{0.01 * factor * k:.2f};{k % 7};{k}\n" for k in range(50))
    (tmp_path / "log.csv").write_text(f"{note}\nt [s];u [V];q [rad]\n{rows}")
    table = read_table(tmp_path / "log.csv")
    doubt = doubt_of_decimation(table, find_time_base(table, numbers_of(table), None, 50, None))
    assert ("but the rows are" in doubt) == doubtful
    assert ("rows are 0.1 s apart: what was faster than 5 Hz looks slower" in doubt) == (doubtful and factor == 10)


def _recognised(columns, given=None):
    table = Table(Path("log.csv"), columns)
    return recognise_table(table, {"time": Given.parse(given, list(columns))} if given else None)


STEPS = {
    "voltage": np.repeat([1.0, -2.0, 3.0, -1.0], 50),
    "angle [rad]": np.cumsum(np.repeat([1.0, -2.0, 3.0, -1.0], 50)),
}


@pytest.mark.parametrize(("formula", "unit"), [("tick / 200", "s"), ("tick * 0.005", "s"), ("5 * tick=ms", "ms")])
def test_a_time_may_be_a_formula(formula, unit):
    found = _recognised({"tick": np.arange(200.0), **STEPS}, formula)
    np.testing.assert_allclose(found.base.seconds, 0.005 * np.arange(200), atol=1e-12)
    time = parse_mapping(mapping_of(found, "log", "axis"), "mapping").time
    assert (time.compute, time.column, time.unit) == (formula.partition("=")[0], None, unit)
    assert "tick" not in found.other
    assert found.base.doubt == ""


@pytest.mark.parametrize(
    ("formula", "message"),
    [
        ("tock / 200", "no column 'tock / 200' for the time"),
        ("tick / 200=kg", "not a unit of time"),
        ("-tick", "'-tick' is no time"),
        ("tick / 0", "is no time"),
        ("my tick / 200", "in backquotes: --time '`my tick` / 200'"),
    ],
)
def test_a_formula_that_is_no_time_is_one_line(formula, message):
    with pytest.raises(InputError, match=re.escape(message)):
        _recognised({"tick": np.arange(200.0), "my tick": np.arange(200.0), **STEPS}, formula)


@pytest.mark.parametrize("name", ["u", "voltage [V]", "pwm", "rpm"])
def test_a_signal_by_its_name_is_no_time_however_evenly_it_rises(name):
    rising = np.linspace(-5.0, 5.0, 120)
    with pytest.raises(
        InputError, match=rf"'{re.escape(name)}' rises evenly, but is the (command|velocity) by its name"
    ):
        _recognised({name: rising, "y": np.tanh(rising)})


@pytest.mark.parametrize(("step", "said"), [(5.0, "rises from row to row"), (1.0, "may count the rows")])
def test_a_time_that_no_name_says_is_doubted(step, said):
    found = _recognised({"a": step * np.arange(200.0), **STEPS})
    assert found.base.time.column == "a"
    assert said in found.base.doubt
    assert "--rate HZ" in found.base.doubt


def test_a_buffer_that_was_not_filled_to_its_end_is_no_record():
    columns = {"t": 0.005 * np.arange(200), **STEPS}
    found = _recognised({name: np.concatenate([value, np.zeros(40)]) for name, value in columns.items()})
    assert found.rows == (slice(0, 200),)
    assert found.base.stands_still(slice(200, 240))
