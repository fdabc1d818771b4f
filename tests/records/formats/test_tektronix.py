"""Waveforms with the settings of the oscilloscope beside their first rows."""

from __future__ import annotations

import numpy as np
import pytest

from idloop.errors import InputError
from idloop.records.tables.table_files import read_table

KEYS = [
    "Record Length,2.500000e+03,Points", "Sample Interval,4.0e-05,s", "Trigger Point,1.25e+03,Samples", "Source,CH2,",
    "Vertical Units,V,", "Vertical Scale,5.0e-01,", "Horizontal Units,s,", "Pt Fmt,Y,", "Model Number,TDS2014,",
    "Firmware Version,FV:v7.09,",
]  # fmt: skip


def _write(tmp_path, channels=1, rows=60):
    lines = []
    for k in range(rows):
        readings = "".join(f",   {0.01 * k + channel:.5f}" for channel in range(channels))
        lines.append(f"{KEYS[k] if k < len(KEYS) else ',,'},{-0.02 + 4e-5 * k:014.9f}{readings},")
    path = tmp_path / "F0000CH2.CSV"
    path.write_text("\r\n".join(lines) + "\r\n")
    return path


@pytest.mark.parametrize("options", [{}, {"skip_text": True}])
def test_a_waveform(tmp_path, options):
    table = read_table(_write(tmp_path), options=options)
    assert list(table.columns) == ["time", "CH2"]
    assert table.units == {"time": "s", "CH2": "V"}
    assert table.attributes["sample interval"] == 4e-5
    np.testing.assert_allclose(table.numbers("time"), -0.02 + 4e-5 * np.arange(60))
    np.testing.assert_allclose(table.numbers("CH2"), 0.01 * np.arange(60))


def test_two_channels_in_one_file(tmp_path):
    table = read_table(_write(tmp_path, channels=2))
    np.testing.assert_allclose(table.numbers("CH2"), 1.0 + 0.01 * np.arange(60))


def test_keys_alone_are_a_table_of_no_waveform(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("\n".join(KEYS))
    with pytest.raises(InputError, match="no stamps and readings"):
        read_table(path, "tektronix")


def test_settings_that_are_too_long_are_one_line(tmp_path):
    path = _write(tmp_path)
    path.write_text(path.read_text().replace("Source,CH2", f"Source,CH2{'x' * 200_000}"))
    with pytest.raises(InputError, match=r"its settings cannot be read .*; save the waveform again"):
        read_table(path)
