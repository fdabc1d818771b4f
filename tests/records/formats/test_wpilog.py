"""Entries of a data log become columns with stamps of their own; what is cut off is said."""

from __future__ import annotations

import struct

import numpy as np
import pytest
from tests.records.formats.writers import wpilog, wpilog_record

from idloop.errors import InputError
from idloop.records.formats import wpilog as reader
from idloop.records.tables.table_files import read_table

ENTRIES = [
    ("voltage-arm-shooter", "double", "Volt"), ("count", "int64", '{"source":"NT"}'), ("on", "boolean", ""),
    ("gain", "float", ""), ("sysid-test-state-shooter", "string", ""), ("both", "double[]", ""), ("blob", "raw", ""),
]  # fmt: skip
RECORDS = [
    (4, 1_000_000, "quasistatic-forward"), (0, 1_000_000, 1.5), (1, 1_010_000, -3), (2, 1_020_000, True),
    (0, 1_020_000, 2.5), (3, 1_030_000, 0.25), (5, 1_040_000, [1.0, 2.0]), (4, 2_000_000, "quasistatic-forward"),
    (4, 3_000_000, "none"), (4, 4_000_000, "dynamic-reverse"), (4, 4_500_000, "quasistatic-forward"),
    (5, 4_600_000, [3.0, 4.0]), (6, 4_700_000, b"\x01"),
]  # fmt: skip


def _read(tmp_path, data):
    (tmp_path / "log.wpilog").write_bytes(data)
    return read_table(tmp_path / "log.wpilog")


def test_entries_with_their_stamps(tmp_path):
    table = _read(tmp_path, wpilog(ENTRIES, RECORDS, extra=b"made by hand"))
    np.testing.assert_array_equal(table.numbers("voltage-arm-shooter"), [1.5, 2.5])
    np.testing.assert_allclose(table.numbers(table.clocks["voltage-arm-shooter"]), [1.0, 1.02])
    for name, value in (("count", -3.0), ("on", 1.0), ("gain", 0.25)):
        np.testing.assert_array_equal(table.numbers(name), [value])
    np.testing.assert_array_equal(table.numbers("both[1]"), [2.0, 4.0])
    assert table.units == {"voltage-arm-shooter": "V"} | dict.fromkeys(table.clocks.values(), "s")
    assert table.notes == ["entries that hold neither numbers nor texts are left out: blob"]
    assert table.raw("sysid-test-state-shooter")[0] == "quasistatic-forward"


def test_tests_of_sysid_are_parts(tmp_path):
    parts = _read(tmp_path, wpilog(ENTRIES, RECORDS)).parts
    assert list(parts) == ["quasistatic-forward", "dynamic-reverse", "quasistatic-forward-2"]
    assert parts["quasistatic-forward"] == pytest.approx((1.0, 3.0))
    assert parts["dynamic-reverse"] == pytest.approx((4.0, 4.5))


def test_entries_of_one_loop_share_their_stamps(tmp_path):
    records = [(entry, 20_000 * k + late, float(k)) for k in range(20) for entry, late in ((0, 0), (1, 35), (2, 9_000))]
    table = _read(tmp_path, wpilog([(name, "double", "") for name in ("voltage", "position", "slow")], records))
    assert table.clocks == {"voltage": "voltage.time", "position": "voltage.time", "slow": "slow.time"}
    assert table.notes == ["entries logged one after the other have the stamps of the first: position"]


def test_structures_by_their_schemas(tmp_path):
    entries = [
        ("/.schema/struct:Rotation2d", "structschema", ""), ("/.schema/struct:State", "structschema", ""),
        ("state", "struct:State", ""), ("unknown", "struct:Other", ""),
    ]  # fmt: skip
    records = [
        (0, 0, "double value"), (1, 0, "double x; Rotation2d angle;float v[2];enum {off=0, on=1} int8 mode"),
        (2, 10, struct.pack("<ddffb", 1.0, 0.5, 2.0, 3.0, 1)), (2, 20, struct.pack("<ddffb", 2.0, 0.6, 2.5, 3.5, 0)),
        (3, 20, b"\0" * 8),
    ]  # fmt: skip
    table = _read(tmp_path, wpilog(entries, records))
    np.testing.assert_array_equal(table.numbers("state.angle.value"), [0.5, 0.6])
    np.testing.assert_array_equal(table.numbers("state.v[1]"), [3.0, 3.5])
    np.testing.assert_array_equal(table.numbers("state.mode"), [1.0, 0.0])
    assert "left out: unknown" in table.notes[0]


def test_schemas_within_themselves_are_left_out(tmp_path):
    entries = [("/.schema/struct:A", "structschema", ""), ("a", "struct:A", ""), ("u", "double", "")]
    table = _read(tmp_path, wpilog(entries, [(0, 0, "A a[200]"), (1, 1, b"\0" * 8), (2, 2, 1.0)]))
    assert set(table.columns) == {"u", "u.time"}


def test_an_entry_that_starts_again_goes_on(tmp_path):
    whole = wpilog(ENTRIES[:1], [(0, 10, 1.0)])
    finish = wpilog_record(0, 20, b"\x01" + struct.pack("<I", 1))
    again = wpilog(ENTRIES[:1], [(0, 30, 2.0)])[12:]
    table = _read(tmp_path, whole + finish + wpilog_record(1, 25, struct.pack("<d", 9.0)) + again)
    np.testing.assert_array_equal(table.numbers("voltage-arm-shooter"), [1.0, 2.0])


def test_a_record_that_is_cut_off_is_said(tmp_path):
    data = wpilog(ENTRIES, RECORDS)
    table = _read(tmp_path, data[:-3] + b"")
    assert table.notes == ["the last 4 bytes hold no whole record and are left out"]


BAD = {
    "of another version": (b"WPILOG" + struct.pack("<HI", 0x0200, 0), "version 2.0"),
    "an extra header beyond the file": (b"WPILOG" + struct.pack("<HI", 0x0100, 1 << 31), "not a readable WPILib"),
    "cut off in its header": (b"WPILOG\x00", "not a WPILib data log"),
    "no entries": (b"WPILOG" + struct.pack("<HI", 0x0100, 0), "no columns of numbers found"),
    "a start without its names": (wpilog([], []) + wpilog_record(0, 0, b"\0" * 9), "no columns"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_files(tmp_path, name):
    data, words = BAD[name]
    with pytest.raises(InputError, match=words):
        _read(tmp_path, data)


def test_too_many_values_are_one_line(tmp_path, monkeypatch):
    monkeypatch.setattr(reader, "MOST_TABLE", 1000)
    with pytest.raises(InputError, match="its entries take more than"):
        _read(tmp_path, wpilog(ENTRIES[2:3], [(0, k, True) for k in range(100)]))
