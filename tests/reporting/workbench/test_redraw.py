"""Figures that follow new data in place."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("bokeh", reason="no Bokeh: launch_scripts/test installs it")

from bokeh.document import Document
from bokeh.layouts import column
from bokeh.models import ColumnDataSource, DataRange1d, Range1d, Span
from bokeh.models.annotations import Title

from idloop.reporting.figures.theme import DARK, LIGHT, add_legend, new_figure
from idloop.reporting.workbench.redraw import Canvas, streamed


def one_figure(values, name="position", limit=1.0, theme=LIGHT, lines=1, legend=""):
    plot = new_figure(theme, ("time", "s"), (name, "rad"))
    data = ColumnDataSource({"x": np.arange(len(values)), "y": np.asarray(values, dtype=float)})
    drawn = [plot.line("x", "y", source=data, color=theme.models[0], line_width=k + 1.0) for k in range(lines)]
    plot.add_layout(Span(location=limit, dimension="width"))
    if legend:
        add_legend(plot, theme, [(legend, drawn)])
    return plot


@pytest.fixture
def canvas():
    place = column(sizing_mode="stretch_width")
    document = Document()
    document.add_root(place)
    one = Canvas(place)
    one.place = place
    one.document = document
    return one


def values(place):
    return list(place.children[0].renderers[0].data_source.data["y"])


def test_a_figure_of_the_same_shape_stays_and_has_the_new_values(canvas):
    canvas.draw([one_figure([1.0, 2.0, np.nan], limit=1.0, legend="model A (rms 2 rad)")])
    first, models = canvas.place.children[0], len(canvas.document.models)
    for step in (3.0, 4.0):
        canvas.draw([one_figure([step, step + 1.0], name="angle", limit=step, legend=f"model B (rms {step} rad)")])
        assert canvas.place.children == [first]
        assert values(canvas.place) == [step, step + 1.0]
        assert first.yaxis.axis_label == "angle [rad]"
        assert [one.location for one in first.center if isinstance(one, Span)] == [step]
        assert first.select(type=type(first.legend[0].items[0]))[0].label.value == f"model B (rms {step} rad)"
        assert len(canvas.document.models) == models


def test_only_what_is_new_is_sent(canvas):
    canvas.draw([one_figure([1.0, 2.0])])
    sent = []
    canvas.document.on_change(sent.append)
    canvas.draw([one_figure([1.0, 2.0])])
    assert sent == []
    canvas.draw([one_figure([1.0, 2.5])])
    assert [event.attr for event in sent] == ["data"]


def test_what_a_reader_has_changed_stays(canvas):
    canvas.draw([one_figure([1.0, 2.0])])
    plot = canvas.place.children[0]
    assert isinstance(plot.x_range, DataRange1d)
    plot.x_range.start, plot.x_range.end = 0.25, 0.5
    plot.toolbar.active_drag = plot.toolbar.tools[0]
    canvas.draw([one_figure([5.0, 6.0])])
    assert canvas.place.children == [plot]
    assert (plot.x_range.start, plot.x_range.end) == (0.25, 0.5)
    assert plot.toolbar.active_drag is plot.toolbar.tools[0]


def test_reset_goes_back_to_the_range_that_is_drawn(canvas):
    for end in (3.0, 7.0):
        plot = one_figure([1.0, 2.0])
        plot.x_range = Range1d(start=0.0, end=end)
        canvas.draw([plot])
    shown = canvas.place.children[0].x_range
    assert (shown.end, shown.reset_end) == (7.0, 7.0)


@pytest.mark.parametrize(
    "other",
    [
        lambda: [one_figure([1.0, 2.0], lines=2)],
        lambda: [one_figure([1.0, 2.0]), one_figure([1.0, 2.0])],
        lambda: [one_figure([1.0, 2.0], legend="model")],
        list,
    ],
)
def test_figures_of_another_shape_take_the_place_of_those_before(canvas, other):
    canvas.draw([one_figure([1.0, 2.0])])
    before, wanted = canvas.place.children[0], other()
    canvas.draw(wanted)
    assert canvas.place.children == wanted
    assert before not in canvas.place.children
    canvas.draw([one_figure([7.0])])
    assert values(canvas.place) == [7.0]


def test_the_same_models_joined_in_another_way_are_another_figure(canvas):
    def joined(shared):
        plot = one_figure([1.0, 2.0])
        sources = [ColumnDataSource({"x": [0.0], "y": [k]}) for k in (1.0, 2.0)]
        for k in range(3):
            plot.line("x", "y", source=sources[k == shared])
        return plot

    canvas.draw([joined(1)])
    second = joined(2)
    canvas.draw([second])
    assert canvas.place.children == [second]


def test_another_theme_reaches_every_colour(canvas):
    canvas.draw([one_figure([1.0, 2.0])])
    canvas.draw([one_figure([1.0, 2.0], theme=DARK)])
    plot = canvas.place.children[0]
    assert plot.background_fill_color == DARK.surface
    assert plot.renderers[0].glyph.line_color == DARK.models[0]
    assert plot.select_one(Title).text_color == DARK.muted


def test_rows_are_streamed_so_that_a_browser_does_not_build_its_legends_anew(canvas):
    canvas.draw([one_figure([1.0, 2.0], legend="model")])
    sent = []
    canvas.document.on_change(sent.append)
    canvas.draw([one_figure([3.0, 4.0, np.nan], legend="model")])
    (event,) = [one for one in sent if one.attr == "data"]
    assert (type(event).__name__, event.rollover) == ("ColumnsStreamedEvent", 3)
    np.testing.assert_array_equal(values(canvas.place), [3.0, 4.0, np.nan])
    # Where the columns have become others, they are sent whole.
    source = ColumnDataSource({"x": np.arange(3.0), "y": ["a", "b", "c"]})
    for data in ({"x": np.arange(3), "y": ["a"] * 3}, {"x": np.arange(3.0)}, {"x": np.zeros(2), "y": ["a"] * 2}):
        assert not streamed(source, data)
    assert streamed(source, {"x": np.zeros(4), "y": list("defg")})
    assert list(source.data["y"]) == list("defg")


def test_fewer_rows_are_sent_whole(canvas):
    """BokehJS keeps the tail of a longer column when fewer rows stream in."""
    canvas.draw([one_figure([1.0, 2.0, 3.0])])
    sent = []
    canvas.document.on_change(sent.append)
    canvas.draw([one_figure([4.0, 5.0])])
    assert [type(event).__name__ for event in sent if event.attr == "data"] == ["ColumnDataChangedEvent"]
    assert values(canvas.place) == [4.0, 5.0]


def test_another_background_is_drawn_anew(canvas):
    """BokehJS would leave a line of the old one."""
    canvas.draw([one_figure([1.0, 2.0])])
    (first,) = canvas.place.children
    canvas.draw([one_figure([1.0, 2.0], theme=DARK)], anew=True)
    assert canvas.place.children != [first]
    assert canvas.place.children[0].background_fill_color == DARK.surface
