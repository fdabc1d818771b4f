"""A table with a row for each value, as databases export it, becomes a column for each name."""

from __future__ import annotations

import numpy as np
import pytest

from idloop.records.tables.table_files import read_table

COUNT = 30


def _write(tmp_path, head, rows):
    path = tmp_path / "log.csv"
    path.write_text(head + "\n" + "".join(f"{row}\n" for row in rows), encoding="utf-8")
    return path


@pytest.mark.parametrize("blocks", [True, False])
def test_names_become_columns_with_a_common_time(tmp_path, blocks):
    rows = [(k, name) for name in ("u_V", "angle_deg") for k in range(COUNT)]
    rows = rows if blocks else sorted(rows, key=lambda row: row[0])
    text = [f"{name};{5 * k};{k if name == 'u_V' else -k};1" for k, name in rows]
    table = read_table(_write(tmp_path, "VarName;Time_ms;VarValue;Validity", text))
    assert list(table.columns) == ["Time_ms", "u_V", "angle_deg"]
    np.testing.assert_array_equal(table.numbers("Time_ms"), 5.0 * np.arange(COUNT))
    np.testing.assert_array_equal(table.numbers("angle_deg"), -np.arange(COUNT))
    assert table.units == {"Time_ms": "ms"}
    assert table.clocks == {}


def test_series_with_stamps_of_their_own_keep_them(tmp_path):
    rows = [f"a,{0.01 * k:.2f},{k}" for k in range(COUNT)] + [f"b,{0.005 + 0.02 * k:.3f},{k}" for k in range(COUNT)]
    table = read_table(_write(tmp_path, "_field,_time,_value", rows))
    assert table.clocks == {"a": "a._time", "b": "b._time"}


def test_phases_of_a_run_are_no_signals(tmp_path):
    rows = [f"{'up' if k < 15 else 'down'},{0.01 * k:.2f},{k}" for k in range(COUNT)]
    assert list(read_table(_write(tmp_path, "phase,t,speed", rows)).columns) == ["phase", "t", "speed"]


def test_a_topic_and_a_path_name_a_signal_together(tmp_path):
    rows = [f"{0.01 * k:.2f},{one},{k}" for k in range(COUNT) for one in ("/joint_states,position[0]", "/cmd,data")]
    table = read_table(_write(tmp_path, "elapsed time,topic,message path,value", rows))
    assert list(table.columns) == ["elapsed time", "/joint_states.position[0]", "/cmd.data"]
    assert "'topic' and 'message path' name it" in table.notes[-1]


def test_a_state_beside_the_names_is_no_name(tmp_path):
    rows = [f"{0.01 * k:.2f},{one},{'on' if k < 15 else 'off'},{k}" for k in range(COUNT) for one in ("a", "b")]
    assert list(read_table(_write(tmp_path, "t,name,state,value", rows)).columns) == ["t", "name", "state", "value"]
