"""The verdict leads, faults follow with their cures, then notes, then tables."""

from __future__ import annotations

import numpy as np

from idloop.records import inspect_bag, make_stream, write_bag
from idloop.reporting.text.blocks import as_text
from idloop.reporting.text.inspection import comparison_blocks, inspection_blocks


def _bag(path):
    stamps = np.delete(10**9 + 10**7 * np.arange(600), np.arange(100, 103))
    k = np.arange(597)
    states = {"arm": {"position": np.sin(k / 30), "velocity": 100 / 30 * np.cos(k / 30)}}
    command = {"arm": {"effort": np.sin(k / 30) + np.sin(k / 11)}}
    return write_bag(path, [make_stream("joint_command", stamps, command), make_stream("joint_states", stamps, states)])


def test_order_of_the_parts(tmp_path):
    inspection = inspect_bag(_bag(tmp_path / "bag"))
    lines = as_text(inspection_blocks(inspection)).splitlines()
    assert lines[0] == f"Verdict: {inspection.grade}: {inspection.grade_reason}"
    first_table = next(k for k, line in enumerate(lines) if line.startswith("topic"))
    faults = [k for k, line in enumerate(lines) if line.startswith("warning: ")]
    assert len(faults) == len(inspection.faults) > 0
    assert max(faults) < first_table
    lost = next(line for line in lines if "samples are missing" in line)
    assert "record on the machine that measures" in lost


def test_rows_of_several_recordings(tmp_path):
    found = [inspect_bag(_bag(tmp_path / name)) for name in ("a.1", "a.2")]
    lines = as_text(comparison_blocks(found, [])).splitlines()
    assert [line.split()[0] for line in lines[2:4]] == ["a.1", "a.2"]
    assert any(line.startswith("No fault between the recordings") for line in lines)
