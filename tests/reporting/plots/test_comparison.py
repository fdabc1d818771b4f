"""The comparison figure: units on every axis, linked times, lines that differ, and files that can be written."""

from __future__ import annotations

import numpy as np
import pytest

from idloop import drawing
from idloop.errors import IdloopError
from idloop.records import Record
from idloop.reporting.panel import Panel
from idloop.reporting.plots.comparison import plot_panels

TIME = np.linspace(0.0, 2.0, 41)


def panel(title: str = "train", **changes) -> Panel:
    output = np.column_stack([np.sin(TIME), np.cos(TIME)])
    names, units = ("motor.position", "motor.velocity"), ("rad", "rad/s")
    command = np.sign(np.sin(3 * TIME[::2]))
    given = {
        "title": title,
        "record": Record(title, TIME[::2], command, TIME, output, "motor.effort", "V", names, units),
        "time": TIME,
        "output": output,
        "modelled": {"a": 0.9 * output, "b": 0.8 * output},
        "band": np.array([0.1, np.nan]),
        "notes": {"a": ["FIT 90 %", "FIT 90 %"]},
        **changes,
    }
    return Panel(**given)


def figure(*panels: Panel):
    return plot_panels(panels)


def test_every_row_names_its_quantity_and_unit():
    labels = [axes.get_ylabel() for axes in figure(panel()).axes]
    assert labels == [
        "motor.position [rad]",
        "residual [rad]",
        "motor.velocity [rad/s]",
        "residual [rad/s]",
        "motor.effort [V]",
    ]
    assert figure(panel()).axes[-1].get_xlabel() == "time [s]"


def test_the_time_axes_of_a_record_move_together():
    axes = figure(panel("train"), panel("validation")).axes
    left = [a for a in axes if a.get_subplotspec().colspan.start == 0]
    left[0].set_xlim(0.5, 0.7)
    assert all(a.get_xlim() == (0.5, 0.7) for a in left)
    assert all(a.get_xlim() != (0.5, 0.7) for a in axes if a not in left)


def test_lines_are_the_measured_and_modelled_values_and_differ_in_look():
    top, below = figure(panel()).axes[:2]
    measured, a, b = top.lines
    np.testing.assert_array_equal(measured.get_ydata(), np.sin(TIME))
    np.testing.assert_allclose(a.get_ydata(), 0.9 * np.sin(TIME))
    assert len({line.get_color() for line in (measured, a, b)}) == 3
    assert a.get_linestyle() != b.get_linestyle()
    np.testing.assert_allclose(below.lines[1].get_ydata(), 0.1 * np.sin(TIME))
    assert [text.get_text() for text in top.get_legend().get_texts()] == ["measured", "a (FIT 90 %)", "b"]


def test_the_band_is_drawn_where_it_is_known():
    axes = figure(panel()).axes
    assert len(axes[1].patches) == 1
    assert len(axes[3].patches) == 0


@pytest.mark.slow
@pytest.mark.parametrize("suffix", (".png", ".svg", ".pdf"))
def test_equal_figures_are_equal_files(suffix, tmp_path):
    one, two = (drawing.save(figure(panel()), tmp_path / f"{name}{suffix}") for name in ("one", "two"))
    assert one.stat().st_size > 1000
    assert one.read_bytes() == two.read_bytes()


def test_long_records_become_images_inside_vector_files():
    time = np.linspace(0.0, 1.0, 2 * drawing.RASTERISE_FROM)
    long = panel(time=time, output=np.zeros((len(time), 2)), modelled={}, notes={})
    assert figure(long).axes[0].lines[0].get_rasterized()
    assert not figure(panel()).axes[0].lines[0].get_rasterized()


def test_a_file_that_cannot_be_written_is_said(tmp_path):
    with pytest.raises(IdloopError, match="cannot write"):
        drawing.save(figure(panel()), tmp_path / "nowhere" / "a.png")


def test_a_pure_number_has_a_dash_for_its_unit():
    assert drawing.label("ratio", "") == "ratio [-]"


def test_drawing_leaves_the_settings_of_the_user_alone():
    import matplotlib as mpl

    before = dict(mpl.rcParams)
    figure(panel())
    assert dict(mpl.rcParams) == before
