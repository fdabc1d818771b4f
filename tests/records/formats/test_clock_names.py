"""Names that mean stamps, with their units."""

from __future__ import annotations

import pytest

from idloop.records.tables.base_units import clock_unit, known_clock_unit


@pytest.mark.parametrize(
    ("name", "unit"),
    [("t", ""), ("Time", ""), ("__time", ""), ("timestamp_us", "us"), ("time [ms]", "ms"), ("Time (s)", "s"),
     ("t_ns", "ns"), ("millis", "ms"), ("Zeit", ""), ("tout", ""), ("time.s", "s"),
     ("elapsed time", ""), ("Receive_Time [ns]", "ns")],
)  # fmt: skip
def test_stamps(name, unit):
    assert clock_unit(name) == unit


@pytest.mark.parametrize(
    "name", ["u", "torque", "ts", "ms", "runtime", "time constant", "timeout", "dead time", "t1", "", "[ms]"]
)
def test_others(name):
    assert clock_unit(name) is None


@pytest.mark.parametrize(("text", "unit"), [("[ms]", "ms"), ("µs", "us"), ("seconds", "s"), ("V", ""), ("", "")])
def test_units(text, unit):
    assert known_clock_unit(text) == unit
