"""A single wrong or missing stamp is found; a time that starts again is none."""

from __future__ import annotations

import numpy as np
import pytest

import idloop
from idloop.records.tables.stamps import bad_stamps, in_order, missing_stamps

K = np.arange(1000.0)


def _with(**changed):
    stamp = K.copy()
    for row, value in changed.items():
        stamp[int(row[1:])] = value
    return stamp


CASES = {
    "too early": (_with(r500=3.0), [500]),
    "too late": (_with(r500=900.0), [500]),
    "two of them": (_with(r200=0.0, r500=1e6), [200, 500]),
    "two that changed places": (_with(r500=501.0, r501=500.0), [501]),
    "a new run": (np.concatenate([K, K]), []),
    "runs of one row and more": (np.concatenate([K, [0.0], K]), []),
    "a gap": (np.concatenate([K, K + 5000.0]), []),
    "too many": (np.where(K % 20 == 19, 0.0, K), []),
    "few": (np.array([0.0, 1.0]), []),
}


@pytest.mark.parametrize("name", CASES)
def test_rows_out_of_order(name):
    stamp, rows = CASES[name]
    bad = bad_stamps(stamp)
    assert np.flatnonzero(bad).tolist() == rows
    if rows:
        assert (np.diff(in_order(stamp, bad)) >= 0).all()
        assert (np.diff(stamp[~bad]) > 0).all()


def test_a_row_with_a_bad_stamp_is_left_out_of_one_record(tmp_path):
    time = 0.01 * K
    time[700] = 1.5
    command = np.sign(np.sin(time))
    rows = np.column_stack([time, command, np.cumsum(command) * 0.01])
    np.savetxt(tmp_path / "a.csv", rows, delimiter=",", header="t [s],u [V],q [rad]", comments="", fmt="%.4f")
    begun = idloop.start(tmp_path / "a.csv", tmp_path / "out", fitted=False)
    assert begun.log.notes == ["a.csv: row 700 is left out: its stamp stands out of order between those beside it"]
    (record,) = idloop.read_bags(begun.bags, begun.model)
    assert np.diff(record.time).max() == pytest.approx(0.02, abs=1e-6)


def test_rows_without_a_stamp_are_left_out_of_one_record(tmp_path):
    time = 0.01 * K
    command = np.sign(np.sin(time))
    rows = np.column_stack([time, command, np.cumsum(command) * 0.01])
    rows[[0, 1, 700]] = np.nan
    np.savetxt(tmp_path / "a.csv", rows, delimiter=",", header="t [s],u [V],q [rad]", comments="", fmt="%.4f")
    begun = idloop.start(tmp_path / "a.csv", tmp_path / "out", fitted=False)
    assert begun.log.notes == ["a.csv: rows 0, 1, 700 are left out: they have no stamp"]
    (record,) = idloop.read_bags(begun.bags, begun.model)
    assert record.time.size == K.size - 3
    assert np.diff(record.time).max() == pytest.approx(0.02, abs=1e-6)


def test_a_column_with_many_missing_stamps_is_no_time():
    stamp = np.where(K % 10 == 0, np.nan, K)
    assert not missing_stamps(stamp).any()
    stamp = np.where(K % 50 == 0, np.nan, K)
    missing = missing_stamps(stamp)
    assert np.flatnonzero(missing).tolist() == list(range(0, 1000, 50))
    assert in_order(stamp, missing)[[0, 1, 49, 50]].tolist() == [1.0, 1.0, 49.0, 49.0]
