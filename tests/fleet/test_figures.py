"""Heat map and trends of a fleet."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from idloop.fleet.figures import FRAME, bands, deviations, heat_map, plot_fleet, trend
from idloop.fleet.joint_day import FORCE_ERROR
from idloop.fleet.statistics import Series, take_apart

NAMES = tuple((f"r{k}", "j") for k in range(8))
DAYS = np.arange(6.0) + 20000.0


@pytest.fixture(scope="module")
def components():
    rng = np.random.default_rng(0)
    y = 1.0 + 0.1 * rng.normal(size=(8, 1)) + 0.01 * rng.normal(size=(8, 6))
    y[5] += 2.0
    y[2, 3] = np.nan
    error = np.log(0.05) + 0.1 * rng.normal(size=(8, 6))
    return [
        take_apart(Series("kind", "p", "N", NAMES, DAYS, y, np.full(y.shape, 1e-4))),
        take_apart(Series("kind", FORCE_ERROR, "1", NAMES, DAYS, error, np.zeros(error.shape))),
    ]


def test_the_joint_that_deviates_most_is_on_top(components):
    names, days, size, parameter = deviations(components)
    assert names[0] == ("r5", "j")
    assert set(parameter[0]) == {"p"}
    assert np.min(size[0]) > np.max(size[1:])
    np.testing.assert_array_equal(days, DAYS)
    assert np.isfinite(size).all(), "where one parameter is not known the other one counts"
    assert deviations([])[0] == []


def test_a_click_opens_the_report_of_every_joint(components):
    (plot,) = heat_map(components, {name: f"joints/k.html?{name[0]} j" for name in NAMES}, {("r5", "j")})
    cells = plot.renderers[0].data_source.data
    assert all(
        report == f"joints/k.html?{joint}" for report, joint in zip(cells["report"], cells["joint"], strict=True)
    )
    assert set(cells["joint"]) == {f"{robot} j" for robot, _ in NAMES}
    assert {joint for joint, one in zip(cells["joint"], cells["diagnosed"], strict=True) if one == "yes"} == {"r5 j"}
    frames = list(plot.select({"name": FRAME}))
    assert [list(one.data_source.data["y"]) for one in frames] == [["r5 j"], ["r5 j"]]
    assert {(one.glyph.left, one.glyph.right) for one in frames} == {(0.0, len(DAYS))}
    assert len({one.glyph.line_color for one in frames}) == 2, "one of them stands out from any cell"
    (scale,) = plot.above
    assert scale.color_mapper is plot.renderers[0].glyph.fill_color.transform, "the colours have a legend"
    (tap,) = [tool for tool in plot.tools if type(tool).__name__ == "TapTool"]
    assert tap.callback.url == "@report"


def test_bands_hold_their_share_of_the_joints(components):
    middle, ((low, high), (inner_low, inner_high)) = bands(components[0])
    assert np.all((low < inner_low) & (inner_low < middle) & (middle < inner_high) & (inner_high < high))
    assert not components[0].kept[5]
    assert np.max(high) < 2.0, "without the one that its mean leaves out"
    middle, _ = bands(components[1])
    assert middle == pytest.approx(5.0, rel=0.1), "a logarithm is drawn as a percentage"


def test_a_joint_that_is_shown_has_its_own_line(components):
    plain, shown = (trend(components[0], names)[0] for names in ([], [("r5", "j"), ("other", "j")]))
    assert len(shown.renderers) == len(plain.renderers) + 3
    said = [item.label.value for item in shown.above[0].items]
    assert said == [
        "median, 68 % and 95 % of the joints, without 1 too far off",
        "r5 j, bars: 95 % interval of the fit",
    ]
    (hover,) = [tool for tool in shown.tools if type(tool).__name__ == "HoverTool"]
    assert ("p", "@y N") in hover.tooltips
    (error,) = trend(components[1], [("r5", "j")])
    assert [item.label.value for item in error.above[0].items][1:] == ["r5 j"], "it has no interval"
    (chosen,) = trend(components[0], [], "place")
    assert chosen.select_one({"name": "place"}).data == {"x": [], "y": [], "low": [], "high": []}


def test_no_bar_reaches_below_the_bound_of_its_parameter(components):
    series = replace(components[0].series, variance=np.full((8, 6), 1.0), least=0.0)
    (plot,) = trend(replace(components[0], series=series), [("r1", "j")])
    low = plot.renderers[-1].data_source.data["low"]
    assert np.min(low) == 0.0


def test_every_parameter_has_a_row_on_paper(components):
    assert [axis.get_ylabel() for axis in plot_fleet(components).axes] == [
        "p [N]",
        "force error [% of drive force]",
    ]
    assert plot_fleet([]).axes
