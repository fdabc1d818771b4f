"""The table is found in a text file whatever stands above, below and between its rows."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from idloop.errors import InputError
from idloop.records.tables.csv_file import read_csv
from idloop.records.tables.csv_layout import find_layout
from idloop.records.tables.table_files import read_table


def _lines(text):
    return [line + "\n" for line in text.splitlines() if line.strip()]


NAMES = {
    "notes above, of one width": (
        "Scope;;;\nDate: 2024-03-01 12:00;;;\nPeriod;1;;\n;;;\nTime [ms];Angle [inc];I [mA];\n0;12;100;\n1;13;100;\n",
        (";", ["Time [ms]", "Angle [inc]", "I [mA]", ""]),
    ),
    "texts of a controller above": (
        "Booting...\nCalibrating motor 3 of 4\nready\ntime_ms,pwm,rpm\n0,100,0.0\n20,100,1.2\ndone\n",
        (",", ["time_ms", "pwm", "rpm"]),
    ),
    "names with units between blanks": (
        "time [s]   volt [V]   angle [rad]\n0.0  1.0  2\n0.1  1.0  3\n",
        (" ", ["time [s]", "volt [V]", "angle [rad]"]),
    ),
    "numbers as names": ("time,1,2\n0,1,2\n0.1,2,3\n", (",", ["time", "1", "2"])),
    "decimal commas and a row of units": (
        "Zeit;Drehzahl;Strom\ns;1/min;A\n0,0;1,0;2\n0,1;2,0;3\n",
        (";", ["Zeit", "Drehzahl", "Strom"]),
    ),
    "a pair of texts above two columns": ("Scope export;v2\nDate;2024\nt;u\n0;1\n1;2\n", (";", ["t", "u"])),
    "bars": ("t|u\n0|1\n1|2\n", ("|", ["t", "u"])),
    "dates": (
        "when,u\n2025-11-12T10:03:29.555Z,3\n2025-11-12T10:03:29.655Z,4\n",
        (",", ["when", "u"]),
    ),
}


NAMES |= {
    "a preamble of names and numbers": (
        "Model,T1,,\nScale,2,,\nInterval,0.01,,\nLabel,,,\nTIME,CH1,CH2,\n0,1,2,\n1,2,3,\n2,3,4,\n",
        (",", ["TIME", "CH1", "CH2", ""]),
    ),
    "numbered channels above units": ("x-axis,1,2\nsecond,Volt,Volt\n0,1,2\n1,2,3\n", (",", ["x-axis", "1", "2"])),
    "units without names": ("second,Volt,Volt\n0,1,2\n1,2,3\n", (",", [])),
    "numbers beside units": (
        "X,CH1,Start,Increment\nSequence,Volt,-1e-2,1e-3\n0,1.5,,\n1,2.5,,\n",
        (",", ["X", "CH1", "Start", "Increment"]),
    ),
}
NAMES |= {
    "notes filled up with empty cells": (
        "Run of 12 March;;;\nTest bench 3;;;\nTime [ms];Torque [Nm];Angle [deg];Speed [1/min]\n0;1;2;3\n2;1;2;3\n",
        (";", ["Time [ms]", "Torque [Nm]", "Angle [deg]", "Speed [1/min]"]),
    ),
    "a first column without a name above units": (",t,u\n-,s,V\n0,0.0,1\n1,0.1,2\n", (",", ["", "t", "u"])),
}


@pytest.mark.parametrize("name", NAMES)
def test_header_and_delimiter_are_found(name):
    text, (delimiter, names) = NAMES[name]
    layout = find_layout(_lines(text))
    assert (layout.delimiter, layout.names) == (delimiter, names)


def test_rows_without_a_header():
    layout = find_layout(_lines("0.1 2\n0.2 3\n"))
    assert (layout.names, layout.first, layout.delimiter) == ([], 0, " ")


@given(
    st.sampled_from([";", "\t", ",", "|"]),
    st.integers(2, 6),
    st.integers(2, 30),
    st.lists(st.sampled_from(["log of a drive", "Rate 1000 Hz", "serial number 7", "=====", "x"]), max_size=8),
)
def test_any_notes_above_any_table(delimiter, width, rows, notes):
    names = [f"signal {k}" for k in range(width)]
    table = [delimiter.join(f"{0.5 * row + column:.3f}" for column in range(width)) for row in range(rows)]
    layout = find_layout([line + "\n" for line in [*notes, delimiter.join(names), *table]])
    assert layout.delimiter == delimiter
    assert layout.names == names
    assert layout.first == len(notes) + 1


def _read(tmp_path, text, rows=slice(0, None), **options):
    path = tmp_path / "a.csv"
    path.write_text(text, encoding="utf-8")
    return read_csv(path, options, rows)


SERIAL = "ready\nt,u\n0,1\n1,2\nlimit reached\n2,3\nt,u\n0,4\n1,\nALL DONE\n"


def test_a_semicolon_that_ends_every_line_is_no_part_of_the_last_cell(tmp_path):
    rows = [(0.01 * k, 200 + k, 0.5 * k) for k in range(60)]
    path = tmp_path / "serial.txt"
    path.write_text("time, pwm, speed;\n" + "".join(f"{t:.2f}, {u}, {w:.3f};\r\n" for t, u, w in rows))
    table = read_csv(path, {})
    assert list(table.columns) == ["time", "pwm", "speed"]
    np.testing.assert_allclose(table.columns["speed"], [w for *_, w in rows])
    # Between cells it stays what it is.
    path.write_text("time;pwm;note\n" + "".join(f"{t:.2f};{u};\n" for t, u, _ in rows))
    assert list(read_csv(path, {}).columns)[:2] == ["time", "pwm"]


def test_text_between_the_rows_is_left_out_where_asked(tmp_path):
    table = _read(tmp_path, SERIAL, skip_text=True)
    np.testing.assert_array_equal(table.columns["t"], [0, 1, 2, 0, 1])
    np.testing.assert_array_equal(table.columns["u"], [1, 2, 3, 4, np.nan])
    assert table.text.text_rows == [2, 3, 5]
    assert table.text.preamble == ["ready"]
    assert table.notes == [
        "1 line above the header is left out",
        "3 lines of text between the rows are left out, before row 2, 3, 5",
    ]


def test_rows_that_were_cut_off_are_no_lines_of_text(tmp_path):
    table = _read(tmp_path, "t,u,y\n0,1,1\n1,2,2\n2,3\n3,4,4\nstall\n4,5,5,5,5\n5,6,6\n6,7", skip_text=True)
    np.testing.assert_array_equal(table.columns["t"], [0, 1, 3, 5])
    assert table.notes == [
        "1 line of text between the rows is left out, before row 3",
        "2 rows of another number of cells are left out, before row 2, 3",
        "the last row is left out: the file ends within it",
    ]
    assert table.text.skipped


@pytest.mark.parametrize(("rows", "values"), [(slice(0, 2), [1, 2]), (slice(3, 4), [3])])
def test_rows_outside_of_the_chosen_ones_are_not_looked_at(tmp_path, rows, values):
    np.testing.assert_array_equal(_read(tmp_path, SERIAL, rows).columns["u"], values)


def test_numbers_beside_the_units_hold_for_all_rows(tmp_path):
    table = _read(tmp_path, "X,CH1,Start,Increment\nSequence,Volt,-1e-2,1e-3\n0,1.5,,\n1,2.5,,\n")
    assert table.attributes == {"Start": -0.01, "Increment": 0.001}
    assert table.units == {"X": "Sequence", "CH1": "Volt"}


def test_numbers_beyond_the_rows_hold_for_all_of_them(tmp_path):
    table = _read(tmp_path, "X,CH1,Start,Increment,\nSequence,VOLT,-1.2e-02,2.4e-05\n0,1.5\n1,2.5\n2,3.5\n")
    assert list(table.columns) == ["X", "CH1"]
    assert table.attributes == {"Start": -0.012, "Increment": 2.4e-05}


def test_the_delimiter_that_a_spreadsheet_writes(tmp_path):
    table = _read(tmp_path, "sep=;\nt;u\n0;1,5\n1;2,5\n")
    np.testing.assert_array_equal(table.columns["u"], [1.5, 2.5])


def test_units_in_a_line_above_the_header(tmp_path):
    head = "Model,M1\n{}Sample Interval,0.002\nVertical Units,V,A\nTIME,CH1,CH2\n"
    rows = "0,1,2\n1,2,3\n2,3,4\n"
    assert _read(tmp_path, head.format("Horizontal Units,s\n") + rows).units == {"CH1": "V", "CH2": "A"}
    one = head.format("Horizontal Units,s\n").replace(",V,A", ",V").replace(",CH2", "")
    assert _read(tmp_path, one + "0,1\n1,2\n2,3\n").units == {"CH1": "V"}
    assert _read(tmp_path, head.format("").replace(",V,A", ",V,division") + rows).units == {}


GROUPS = {
    "a line of groups": ("Zeit;Drehmoment;;Drehzahl;\n;Soll;Ist;Soll;Ist\n(ms);(Nm);(Nm);(1/min);(1/min)\n", 5),
    "no units": ("Zeit;Drehmoment;;Drehzahl;\n;Soll;Ist;Soll;Ist\n", 5),
    "a group at each column": ("Zeit;Drehmoment;Drehmoment;Drehzahl;Drehzahl\n;Soll;Ist;Soll;Ist\n", 5),
    "a column of no group": ("Zeit;Drehmoment;;Drehzahl;;Strom\n;Soll;Ist;Soll;Ist;\n", 6),
}


@pytest.mark.parametrize("name", GROUPS)
def test_names_that_are_alike_are_told_apart_by_their_groups(tmp_path, name):
    text, width = GROUPS[name]
    rows = "".join(";".join(str(k + column) for column in range(width)) + "\n" for k in range(4))
    table = _read(tmp_path, text + rows)
    names = ["Zeit", "Drehmoment Soll", "Drehmoment Ist", "Drehzahl Soll", "Drehzahl Ist", "Strom"][:width]
    assert list(table.columns) == names
    assert [table.columns[name][1] for name in names] == list(range(1, width + 1))
    assert not table.text.preamble


def test_units_are_no_groups(tmp_path):
    with pytest.raises(InputError, match="'Set' occurs twice"):
        _read(tmp_path, "Time;Speed;;Torque;\ns;rpm;;Nm;\n;Set;Act;Set;Act\n0;1;2;3;4\n1;1;2;3;4\n")


def test_columns_of_one_name_and_the_same_stamps_are_read_once(tmp_path):
    above = "Interval,0.5,Interval,0.5\nChannel name,Force,Channel name,Input 1\nUnit,N,Unit,V\n"
    table = _read(tmp_path, above + "0,1,0,5\n0.5,2,0.5,6\n1,3,1,7\n")
    assert list(table.columns) == ["Channel name", "Force", "Input 1"]
    np.testing.assert_array_equal(table.columns["Channel name"], [0, 0.5, 1])
    np.testing.assert_array_equal(table.columns["Input 1"], [5, 6, 7])
    assert (table.units["Force"], table.units["Input 1"]) == ("N", "V")
    assert any("columns of one name and the same stamps (Channel name) are read once" in note for note in table.notes)
    with pytest.raises(InputError, match="'Channel name' occurs twice"):
        _read(tmp_path, above + "0,1,0,5\n0.5,2,0.7,6\n1,3,1,7\n")


def test_pairs_of_stamps_and_values(tmp_path):
    table = _read(tmp_path, "Time,Value,Time,Value,,\n0,1,0.5,2,,\n1,2,1.5,3,,\n2,3,,,,\n")
    assert table.clocks == {"Value": "Time", "Value (2)": "Time (2)"}
    np.testing.assert_array_equal(table.columns["Value (2)"], [2, 3])
    np.testing.assert_array_equal(table.columns["Time"], [0, 1, 2])
    table = _read(tmp_path, "Angle,,Voltage,\nTime [ms],Value,Time [ms],Value\n0,1,0,2\n1,2,1,3\n")
    assert list(table.columns) == ["Angle Time [ms]", "Angle Value", "Voltage Time [ms]", "Voltage Value"]
    assert table.clocks == {}  # the stamps are the same
    assert table.units["Angle Time [ms]"] == "ms"
    table = _read(tmp_path, "# t,u,t,y\n0,1,0.5,2\n1,2,1.5,3\n")
    assert table.clocks == {"u": "t", "y": "t (2)"}


CELLS = {
    "as a multimeter writes": "time,voltage,position\n0 ms,0.284 V,0 °\n2 ms,0.29 V,1.5 °\n4 ms,-0.3 V,2 °\n",
    "without a blank": "time,voltage,position\n0ms,0.284V,0°\n2ms,0.29V,1.5°\n4ms,-0.3V,2°\n",
    "decimal commas": "time;voltage;position\n0 ms;0,284 V;0 °\n2 ms;0,29 V;1,5 °\n4 ms;-0,3 V;2 °\n",
    "tabs": "time\tvoltage\tposition\n0 ms\t0.284 V\t0 °\n2 ms\t0.29 V\t1.5 °\n4 ms\t-0.3 V\t2 °\n",
    "a lost reading": "time,voltage,position\n0 ms,0.284 V,0 °\n2 ms,0.29 V,1.5 °\n4 ms,-0.3 V,2 °\n6 ms,,\n",
}


@pytest.mark.parametrize("name", CELLS)
def test_a_unit_in_every_cell_is_that_of_the_column(tmp_path, name):
    table = _read(tmp_path, CELLS[name])
    assert table.units == {"time": "ms", "voltage": "V", "position": "°"}
    np.testing.assert_array_equal(table.columns["voltage"][:3], [0.284, 0.29, -0.3])
    np.testing.assert_array_equal(table.columns["position"][:3], [0, 1.5, 2])


def test_two_units_in_one_column_are_refused(tmp_path):
    with pytest.raises(InputError, match="row 2 of column 'u' is in mV, those before in V"):
        _read(tmp_path, "t,u\n0 s,1.2 V\n1 s,1.1 V\n2 s,900 mV\n")


def test_texts_that_end_in_a_unit_stay_texts(tmp_path):
    table = _read(tmp_path, "t,u,note\n0,1,start\n1,1,2 s\n2,1,end\n")
    assert table.columns["note"] == ["start", "2 s", "end"]
    table = _read(tmp_path, "t,5V,12V\n0,1,2\n1,1,2\n")
    assert list(table.columns) == ["t", "5V", "12V"]


@pytest.mark.parametrize("options", [{}, {"decimal": ","}])
def test_a_point_between_thousands_of_a_file_with_decimal_commas(tmp_path, options):
    """Of three decimals a small number looks like a thousand once its comma is a point."""
    values = [-0.045, 4274.061, -1401.83, 999.5, 12345.678, 7.0] * 4
    written = ["-0,045", "4.274,061", "-1.401,830", "999,500", "12.345,678", "7,000"] * 4
    path = tmp_path / "log.csv"
    path.write_text("t;x\n" + "".join(f"0,{k:03d};{cell}\n" for k, cell in enumerate(written)), encoding="utf-8")
    np.testing.assert_allclose(read_table(path, options=options).numbers("x"), values)


def test_how_dates_are_written_stands_among_the_units(tmp_path):
    head = "Bench 3;;;\nDatum;Uhrzeit;Moment;Lage\nTT.MM.JJJJ;hh:mm:ss,ms;Nm;°\n"
    table = _read(tmp_path, head + "".join(f"02.03.2025;09:00:0{k},5;0,{k};1,{k}\n" for k in range(5)))
    assert list(table.columns) == ["Datum", "Uhrzeit", "Moment", "Lage"]
    assert table.units["Moment"] == "Nm"


def test_points_between_thousands_beside_decimal_commas(tmp_path):
    table = _read(tmp_path, "t [ms]\tu\n" + "".join(f"{t}\t{u}\n" for t, u in [(10, "0,5"), ("1.010", "-1.100,0")]))
    np.testing.assert_array_equal(table.columns["t [ms]"], [10, 1010])
    np.testing.assert_array_equal(table.columns["u"], [0.5, -1100])
    # Without commas a point is the decimal sign, also where each number could be a thousand.
    table = _read(tmp_path, "t,u\n1.250,2.500\n1.500,3.500\n")
    np.testing.assert_array_equal(table.columns["t"], [1.25, 1.5])


@pytest.mark.parametrize("row", ["[{}, {}, 5]", "({}, {}, 5)", "[ {}  {}  5. ]"])
def test_lists_as_python_prints_them(tmp_path, row):
    path = tmp_path / "out.txt"
    path.write_text("".join(row.format(k, 0.5 * k) + "\n" for k in range(4)))
    table = read_table(path)
    np.testing.assert_array_equal(table.columns["1"], [0, 0.5, 1, 1.5])
    np.testing.assert_array_equal(table.columns["2"], np.full(4, 5))


def test_names_and_units_may_stand_in_comments(tmp_path):
    path = tmp_path / "log.csv"
    rows = "nan,nan,nan;\n0.1,0.5,2.0;\n0.2,0.25,3.0;\n"
    path.write_text(f"%Date:,29/04/2021,\n\n%time,voltage,position\n%[s],[V],[turns]\n{rows}")
    found = read_csv(path, {})
    assert found.units == {"time": "[s]", "voltage": "[V]", "position": "[turns]"}
    np.testing.assert_array_equal(found.columns["position"], [np.nan, 2.0, 3.0])
    # Units alone are the names, as they are in a header without others.
    path.write_text(f"%[s],[V],[turns]\n{rows}")
    assert list(read_csv(path, {}).columns) == ["[s]", "[V]", "[turns]"]
    # Below a comment that names the columns a row of units keeps its place.
    path.write_text("# t,u,q\ns,V,V\n0.1,0.5,2.0\n0.2,0.25,3.0\n")
    assert read_csv(path, {}).units == {"t": "s", "u": "V", "q": "V"}


@pytest.mark.parametrize("sign", [",", "\t", " "])
def test_words_before_the_numbers_of_a_row_name_them(tmp_path, sign):
    rows = [("t", 3400 + k, "PWM:", 20 * k, "q", 0.5 * k, 1.5 * k) for k in range(5)]
    table = _read(tmp_path, "opened at 12:39\n" + "".join(sign.join(map(str, row)) + "\n" for row in rows))
    assert list(table.columns) == ["t", "PWM", "q[0]", "q[1]"]
    np.testing.assert_array_equal(table.columns["q[1]"], [0, 1.5, 3, 4.5, 6])
    # One word, or two that are alike, are no names.
    for row in ("INFO,{},{}\n", "{},V,{},V,{}\n"):
        table = _read(tmp_path, "".join(row.format(k, 2 * k, 3 * k) for k in range(5)))
        assert not {"V", "INFO"} & table.columns.keys()


@pytest.mark.parametrize("end", [";", ""])
def test_a_matrix_in_brackets_below_names_of_several_words(tmp_path, end):
    rows = [f"{k:6d} {0.022 * k:8.3f} {-0.5 * k:8.4f}" for k in range(4)]
    text = " Sample   Time     Control Effort\r\n\r\n[" + f"{end}\r\n ".join(rows)
    table = _read(tmp_path, f"{text}]\n", skip_text=True)
    assert list(table.columns) == ["Sample", "Time", "Control Effort"]
    np.testing.assert_array_equal(table.columns["Sample"], range(4))
    np.testing.assert_array_equal(table.columns["Control Effort"], [0, -0.5, -1, -1.5])
    assert not table.notes


def test_a_cell_in_quotes_may_go_over_lines_and_a_sign_for_inches_may_not(tmp_path):
    rows = [f'{k},"+1.5E-0{k}\r\n",{2 * k}' for k in range(1, 6)]
    (tmp_path / "a.csv").write_bytes("\r\n".join(["t,voltage,speed", *rows, ""]).encode())
    table = read_csv(tmp_path / "a.csv", {})
    np.testing.assert_allclose(table.columns["voltage"], 1.5 * 10.0 ** -np.arange(1, 6))
    np.testing.assert_array_equal(table.columns["speed"], 2 * np.arange(1, 6))
    rows = [f"{k},{2 * k}" for k in range(20)]
    (tmp_path / "b.csv").write_text("\n".join(['# a 3" arm', 'a 5" wheel', "t,speed", *rows]))
    assert len(read_csv(tmp_path / "b.csv", {"skip_text": True}).columns["t"]) == 20
