"""The picture of a log names each column with its unit, once."""

from __future__ import annotations

import numpy as np

from idloop.records.recognition.recognise import recognise_table
from idloop.records.tables.table import Table
from idloop.reporting.plots.recording import plot_recognition


def test_a_unit_in_the_name_is_not_repeated(tmp_path):
    t = np.arange(200) * 0.01
    columns = {"t [s]": t, "Torque [Nm]": np.sign(np.sin(9.0 * t)), "angle": np.sin(t), "speed (rad/s)": np.cos(t)}
    figure = plot_recognition(recognise_table(Table(tmp_path / "log.csv", columns)))
    assert [axes.get_ylabel() for axes in figure.axes] == ["Torque [Nm]", "angle [rad]", "speed (rad/s)"]
