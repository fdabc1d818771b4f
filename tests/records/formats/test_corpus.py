"""Every log of the corpus is recognised as its form, and holds the signals that are true of it."""

from __future__ import annotations

import numpy as np
import pytest
from tests.records.formats.corpus import COULOMB, FORMS, INERTIA, VISCOUS, levels, multisine

from idloop.records.formats.registry import form_of, kinds
from idloop.records.tables.table_files import read_table

TEXT = {"arduino_with_text_between"}


def test_there_are_many_forms():
    assert len(FORMS) >= 60


@pytest.mark.parametrize("run", [levels(0), levels(5), multisine(1), multisine(9)])
def test_the_motor_obeys_its_equation(run):
    speed = np.gradient(run.q, run.t)
    moving = np.flatnonzero((np.abs(run.w) > 1.0)[:-1] & (np.sign(run.w[1:]) == np.sign(run.w[:-1])))
    rows = np.column_stack([np.diff(run.w)[moving] * 100.0, run.w[moving], np.sign(run.w[moving])])
    found = np.linalg.lstsq(rows, run.u[moving], rcond=None)[0]
    # A difference over a sample lags by half of it, and the noise of the speed counts: the first to some 15 %.
    assert found[0] == pytest.approx(INERTIA, rel=0.3)
    assert found[1] == pytest.approx(VISCOUS, rel=0.15)
    assert found[2] == pytest.approx(COULOMB, rel=0.4)
    assert np.abs(speed - run.w).mean() < 0.3
    assert min(run.w.max(), -run.w.min()) > 3.0


@pytest.mark.parametrize("name", FORMS)
def test_the_form_is_recognised_and_its_signals_are_there(tmp_path, name):
    log = FORMS[name](tmp_path)
    assert log.kind in kinds()
    options = {"skip_text": True} if name in TEXT else {}
    columns = {}
    for path in log.files:
        assert form_of(path).kind == log.kind
        table = read_table(path, options=options)
        prefix = f"{path.stem}." if name == "one_signal_per_file" else ""
        columns |= {prefix + column: table for column in table.columns}
    for role, truth in log.truth.items():
        assert truth.column in columns, list(columns)
        table = columns[truth.column]
        if role != "time":
            column = truth.column.removeprefix(f"{table.path.stem}.") if name == "one_signal_per_file" else truth.column
            values = table.numbers(column)
            assert np.isfinite(values).sum() >= 400
    if log.kind in ("wpilog", "sysid"):
        assert len(table.parts) == log.records == 4
