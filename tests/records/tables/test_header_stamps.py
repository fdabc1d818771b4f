"""Columns of a topic with a header have its stamps, in a table with a row for each message that was received."""

from __future__ import annotations

import numpy as np
import pytest

from idloop.api.log import recognise
from idloop.records.tables.table_files import read_table

T = np.arange(400) * 0.005
# A recorder that receives several states at once.
RECEIVED = np.maximum.accumulate(T + 0.001 + np.random.default_rng(1).gamma(2.0, 0.002, T.size))


def _log(tmp_path, *, epoch=1.7e9, stamps=True, separator="/"):
    names = [
        "__time",
        *(separator.join(("", "joint_states", *rest)) for rest in (("header", "stamp"), ("q", "position"))),
    ]
    rows = [(when + epoch, f"{stamp + 1.7e9:.6f}" if stamps else "", f"{np.sin(9.0 * stamp):.9f}", "")
            for when, stamp in zip(RECEIVED, T, strict=True)]  # fmt: skip
    rows += [(when + epoch + 3e-4, "", "", f"{np.sign(np.sin(5.0 * when)):.1f}") for when in T]
    lines = [",".join([*names, "/cmd/data"]), *(f"{when:.6f},{','.join(rest)}" for when, *rest in sorted(rows))]
    path = tmp_path / "plot.csv"
    path.write_text("\n".join(lines), encoding="utf-8")
    return path


@pytest.mark.parametrize("separator", ["/", "."])
def test_the_stamps_of_the_header_are_the_time(tmp_path, separator):
    path = _log(tmp_path, separator=separator)
    table = read_table(path)
    stamp, position = (separator.join(("", "joint_states", *one)) for one in (("header", "stamp"), ("q", "position")))
    np.testing.assert_allclose(table.numbers(stamp), T + 1.7e9, atol=1e-5)
    assert table.clocks == {position: stamp, "/cmd/data": "/cmd/data.__time"}
    assert "not the times '__time' of their reception" in table.notes[-1]


def test_the_log_is_recognised_by_them(tmp_path):
    found = recognise(_log(tmp_path), {}).recognition
    assert found.base.time.column == "/joint_states/header/stamp"
    assert (found.of("command").column, found.of("position").column) == ("/cmd/data", "/joint_states/q/position")


@pytest.mark.parametrize("changes", [{"epoch": 0.0}, {"stamps": False}])
def test_stamps_of_another_clock_or_none_are_left(tmp_path, changes):
    assert read_table(_log(tmp_path, **changes)).clocks == {}
