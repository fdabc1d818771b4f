"""The verdict leads, faults follow with their cures, then notes, then tables."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from idloop.records import inspect_bag, make_stream, write_bag
from idloop.reporting.text.blocks import as_text
from idloop.reporting.text.inspection import comparison_blocks, inspection_blocks, recording_lines


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


def test_what_several_recordings_have_in_common_is_said_once(tmp_path):
    found = [inspect_bag(_bag(tmp_path / name)) for name in ("a", "b", "c")]
    found[2] = replace(found[2], findings=[])
    lines = list(recording_lines(found))
    assert [line.partition(": ")[0] for line in lines[:3]] == ["a", "b", "c"]
    shared = lines[3:]
    assert len(shared) == len(found[0].faults) > 1
    assert all(line.startswith("warning in 2 of 3 records (a, b), here a: ") for line in shared)
    lines = list(recording_lines(found[:2]))
    assert all(line.startswith("warning in all 2 records, here a: ") for line in lines[2:])
    assert shared[0].partition(": ")[2] in as_text(inspection_blocks(found[0]))


def test_of_many_recordings_those_without_a_fault_of_their_own_have_one_line_for_each_grade(tmp_path):
    one = inspect_bag(_bag(tmp_path / "run"))
    sound = replace(one, findings=[])
    found = [replace(sound, path=tmp_path / f"run{k}") for k in range(40)]
    found[7] = replace(one, path=tmp_path / "run7")
    lines = list(recording_lines(found))
    assert [line for line in lines if line.startswith("run7: ")] == lines[:1]
    assert lines[-1].startswith("run0, run1, run2, run3, run4, run5, ... (39 in all): ")
    assert len(lines) == 2 + len(one.faults)
    assert len(list(recording_lines(found[10:20]))) == 10
