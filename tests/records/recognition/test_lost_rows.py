"""Samples that a log has lost, by its own counter."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from idloop.records.recognition.guess import Given
from idloop.records.recognition.recognise import recognise_table
from idloop.records.tables.table import Table

K = np.arange(600)
KEPT = np.delete(K, [*range(200, 230), *range(400, 405)])
U = np.sign(np.sin(0.05 * K))
PLACE = np.cumsum(np.cumsum(U)) * 1e-3


def _log(time, seq, rows=KEPT):
    return {"t [s]": time, "seq": seq, "torque [Nm]": U[rows], "angle [rad]": PLACE[rows]}


def _found(columns, period=None, **given):
    said = {name: Given.parse(text, list(columns)) for name, text in given.items()}
    found = recognise_table(Table(Path("log.csv"), columns), said, period=period)
    return found, [doubt for doubt in found.doubts if "samples were lost" in doubt]


@pytest.mark.parametrize("by", [1, 4])
def test_numbers_that_are_left_out_under_even_stamps_are_lost_samples(by):
    _, (doubt,) = _found(_log(0.002 * np.arange(KEPT.size), by * KEPT))
    assert doubt.startswith("'seq' leaves out 35 numbers before row 200, 370, ")
    option = doubt.rpartition("--time ")[2].strip("'")
    again, doubts = _found(_log(0.002 * np.arange(KEPT.size), by * KEPT), time=option)
    np.testing.assert_allclose(again.base.seconds, 0.002 * KEPT, atol=1e-12)
    assert doubts == []


def test_a_rate_that_is_given_is_even_as_well():
    columns = _log(np.zeros(KEPT.size), KEPT)
    del columns["t [s]"]
    assert len(_found(columns, period=0.002)[1]) == 1


@pytest.mark.parametrize(
    "columns",
    [
        _log(0.002 * KEPT, KEPT),
        _log(0.002 * K, K, K),
        _log(0.002 * K, np.cumsum(1 + K % 3), K),
        _log(0.002 * K, np.zeros(K.size), K),
        _log(np.r_[0.002 * K[:300], 0.002 * K[:300]], K, K),
    ],
    ids=["the stamps show it", "nothing was lost", "no counter", "a counter at rest", "two runs"],
)
def test_otherwise_nothing_is_said(columns):
    assert _found(columns)[1] == []
