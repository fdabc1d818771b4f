"""What the interactive figures hold: the numbers of the objects that they are drawn from, names and units."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bokeh.models import LinearAxis, Scatter
from bokeh.models.annotations import BoxAnnotation, Label, Legend, Span

from idloop.reporting.breakdowns import bins
from idloop.reporting.figures.comparison import force_figures, overlay, residual_figures
from idloop.reporting.figures.curves import unknown_figure
from idloop.reporting.figures.effects import (
    ADDED,
    MOST,
    TIED,
    UNTESTABLE,
    WEIGHED,
    Decided,
    candidates_figure,
    drawn_lines,
    evidence_figure,
    ladder_rows,
)
from idloop.reporting.figures.ladder import ROW, ladder_figures, step_names
from idloop.reporting.figures.theme import DARK, LIGHT
from idloop.reporting.figures.where import error_along
from idloop.reporting.page.page_figures import page_figures, where_places
from idloop.reporting.scores import error_lines, force_lines
from idloop.reporting.terms import effect_words, in_words
from idloop.validation.variables import VARIABLES


def labels(plot):
    return plot.xaxis[0].axis_label, plot.yaxis[0].axis_label


def columns(plot, which=0):
    return plot.renderers[which].data_source.data


@pytest.fixture(scope="module")
def judged(contents):
    return contents.judged[0]


@pytest.fixture(scope="module")
def maps(judged):
    return [(label, c.where["motor.velocity"]) for label, c in judged.rows]


def test_overlay_draws_measured_models_residuals_and_the_command_on_one_time_axis(judged):
    record, panel = judged.record, judged.panel
    plots = overlay(panel)
    assert [labels(plot)[1] for plot in plots] == [
        "motor.position [rad]", "residual [rad]", "motor.velocity [rad/s]", "residual [rad/s]", "motor.effort [V]",
    ]  # fmt: skip
    assert labels(plots[-1])[0] == "time [s]"
    assert len({plot.x_range.id for plot in plots}) == 1
    np.testing.assert_allclose(columns(plots[2])["y"], record.output[:, 1], rtol=1e-6)
    for index, modelled in enumerate(panel.modelled.values()):
        np.testing.assert_allclose(columns(plots[2], index + 1)["y"], modelled[:, 1], rtol=1e-5, atol=1e-6)
        left = record.output[:, 1] - modelled[:, 1]
        np.testing.assert_allclose(columns(plots[3], index)["y"], left, rtol=1e-4, atol=1e-6)
    (band,) = [one for one in plots[3].center if isinstance(one, BoxAnnotation)]
    assert band.top == pytest.approx(1.96 * 5e-3)
    said = [item.label["value"] for item in plots[0].above[0].items]
    assert said[0] == "measured"
    assert said[1].startswith("start (FIT ")


def test_overlay_of_a_long_record_stays_small(judged):
    panel = judged.panel
    time = np.arange(0.0, 600.0, 1e-3)
    output = np.sin(time)[:, None] * [1.0, 1.0]
    output[123_456] = 7.0
    output[300_000:400_000] = np.nan
    record = replace(panel.record, time=time, output=output, input_time=time, input=time)
    long = replace(panel, record=record, time=time, output=output, modelled={"start": np.zeros((len(time), 2))})
    plots = overlay(long, buckets=400)
    for plot in plots:
        for drawn in plot.renderers:
            assert len(drawn.data_source.data["x"]) <= 802
            assert drawn.data_source.data["y"].dtype == np.float32
    measured = columns(plots[0])
    assert measured["x"][np.nanargmax(measured["y"])] == pytest.approx(123.456, abs=1.5)
    assert np.nanmax(measured["y"]) == 7.0
    gap = (measured["x"] > 302.0) & (measured["x"] < 398.0)
    assert np.array_equal(np.isnan(measured["y"]), gap | np.isnan(measured["y"]))
    assert np.all(np.isfinite(measured["y"][(measured["x"] < 298.0) | (measured["x"] > 402.0)]))


@pytest.mark.parametrize("variable", VARIABLES)
def test_the_error_along_every_variable_has_names_and_units(maps, variable):
    plot = error_along(maps, variable, DARK)
    across, up = labels(plot)
    assert "[" in across
    assert up.endswith("[rad/s]")
    assert len(plot.above[0].items) == 2


def test_a_long_title_has_two_lines_for_a_phone(maps):
    label, one = maps[0]
    long = replace(one, kind="prediction error 10 steps (0.05 s) ahead")
    short, title = (error_along([(label, each)], "velocity").title.text for each in (one, long))
    assert "\n" not in short
    assert title == f"{one.name}:\n{long.kind}"


def test_bins_say_what_the_breakdown_says(maps):
    breakdown = maps[0][1].along("velocity")
    drawn = bins(breakdown)
    np.testing.assert_allclose(0.5 * (drawn["low"] + drawn["high"]), breakdown.mean)
    np.testing.assert_allclose(drawn["mean"] ** 2 + (drawn["high"] - drawn["mean"]) ** 2, breakdown.rms**2)
    assert np.sum(drawn["error"]) == pytest.approx(100.0, abs=1.0)
    np.testing.assert_allclose(columns(error_along(maps, "velocity"), 1)["mean"], breakdown.mean)


def test_a_variable_that_was_left_out_has_no_figure(maps):
    label, one = maps[0]
    without = replace(one, breakdowns=tuple(b for b in one.breakdowns if b.variable != "position"))
    assert error_along([(label, without)], "position") is None
    assert error_along([], "time") is None


def test_worst_stretches_are_marked_and_numbered(maps):
    label, one = maps[-1]
    maps = [(label, replace(one, stretches=tuple(replace(s, error=0.5, time=0.1) for s in one.stretches)))]
    loud = maps[-1][1].loud_stretches[:3]
    assert loud
    plot = error_along(maps, "time")
    marks = [one for one in plot.center if isinstance(one, BoxAnnotation)]
    assert [(mark.left, mark.right) for mark in marks] == [(stretch.start, stretch.stop) for stretch in loud]
    (numbers,) = (axis.major_label_overrides for axis in plot.above if isinstance(axis, LinearAxis))  # no curve there
    assert numbers == {0.5 * (one.start + one.stop): str(i) for i, one in enumerate(loud, start=1)}


def test_the_ladder_draws_the_numbers_of_its_document(contents):
    document = contents.ladder.to_dict()["ladder"]
    lines = {line.label: line.error for line in error_lines(contents.ladder)}
    for kind, said in (("validation", "unseen data"), ("train", "fitted data")):
        for name in ("motor.position", "motor.velocity"):
            expected = [step[kind]["nrmse"][name] for step in document]
            np.testing.assert_array_equal(lines[f"{name}, {said}"], expected)
        (force,) = [line.error for line in force_lines(contents.ladder) if line.label == f"drive force, {said}"]
        np.testing.assert_allclose(force, [100.0 * step[kind]["force"] for step in document])


def test_a_marker_of_the_ladder_is_hollow_for_fitted_data_wherever_there_are_unseen(contents):
    """Also where nothing is known of the unseen; and a lone step, with nothing to compare it with, is no line."""
    steps = [
        replace(one, train={**one.train, "force": 0.2}, validation={**one.validation, "force": None})
        for one in contents.ladder.steps
    ]
    force, _ = ladder_figures(replace(contents.ladder, steps=tuple(steps), criterion="force"))
    assert labels(force)[0] == "error of the drive force, fitted data [%]"
    (dots,) = [one for one in force.renderers if isinstance(one.glyph, Scatter)]
    assert dots.glyph.fill_color == LIGHT.surface
    lone = replace(steps[0], train={**steps[0].train, "force": None})
    (only,) = ladder_figures(replace(contents.ladder, steps=(lone, *steps[1:]), criterion="force"))
    assert labels(only)[0] == "NRMSE of the free run [-]"


def test_the_ladder_names_its_steps_and_shows_the_noise_floor(contents):
    assert step_names(contents.ladder) == ["0  start", "1  + Coulomb friction @ motor"]
    outputs, force = ladder_figures(contents.ladder, contents.floor)  # judged by predictions
    assert labels(force)[0] == "error of the drive force [%]"
    assert labels(outputs)[0] == "NRMSE of the free run [-]"
    drawn = [one.data_source.data for one in outputs.renderers if "high" in one.data_source.data]
    assert sorted({x for one in drawn for x in one["x"]}) == sorted(contents.floor.values())
    names = [one for one in outputs.center if isinstance(one, Label)]
    assert [one.text for one in names] == step_names(contents.ladder)
    # Nothing is drawn across the words: what a row draws lies below them, and ends above the next row's.
    for one in outputs.renderers:
        data = one.data_source.data
        low, high = (np.asarray(data[name]) for name in (("low", "high") if "high" in data else ("y", "y")))
        assert np.all(high - np.array([name.y for name in names]) <= 9.0 / ROW)
        assert np.all(np.array([name.y for name in names]) - low < 1.0 - 24.0 / ROW)


def test_effects_are_written_as_words():
    assert effect_words("stribeck_friction@load1") == "Stribeck friction @ load1"
    assert effect_words("dead_zone") == "dead zone"
    assert in_words("beside cogging#2@axis") == "beside second cogging @ axis"
    assert in_words("it separates dead_zone@input and sensor_delay@position[motor]; stay below 3 V") == (
        "it separates dead zone @ input and sensor delay @ position[motor]; stay below 3 V"
    )


def test_candidates_are_ranked_with_ties_as_ties_and_what_cannot_be_shown(contents):
    rows = ladder_rows(contents.ladder)
    assert [(row.name, row.standing) for row in rows] == [
        ("coulomb_friction@motor", ADDED),
        ("dead_zone@input", TIED),
        ("backlash@position[motor]", WEIGHED),
        ("saturation@input", UNTESTABLE),
    ]
    assert rows[1].evidence == "as likely as Coulomb friction @ motor"
    assert rows[-1].text == "a limit beyond the data cannot show"
    plot = candidates_figure(rows)
    assert list(columns(plot)["share"]) == [80.0, 80.0, 1.0]
    assert candidates_figure(rows[-1:]) is None


def test_the_drive_side_shows_what_each_model_misses(judged):
    forces = [(label, c.force) for label, c in judged.rows]
    top, below = force_figures(forces, "N·m")
    assert labels(top)[1] == "drive force [N·m]"
    np.testing.assert_allclose(columns(top)["y"], forces[0][1].applied, rtol=1e-5)
    for index, (_, one) in enumerate(forces):
        np.testing.assert_allclose(columns(below, index)["y"], one.applied - one.required, rtol=1e-4, atol=1e-5)
    assert force_figures([], "N") == []
    noisy = [(label, replace(one, noise=1.0)) for label, one in forces]
    words = [item.label.value for item in force_figures(noisy, "N·m")[0].select_one(Legend).items]
    assert len(words) > 1
    assert all(word.endswith("(its error may be noise)") for word in words[1:])


def test_the_unknown_curve_has_its_band(contents):
    plot = unknown_figure(contents.ladder.unknown)
    assert labels(plot) == ("motor.velocity [rad/s]", "remaining force [N·m]")
    drawn = columns(plot)
    np.testing.assert_allclose(drawn["high"] - drawn["low"], 0.2)


def test_residual_tests_are_drawn_with_their_bands(judged):
    test = judged.rows[-1][1].residual_tests()[0]
    own, cross = residual_figures(test)
    named = f"correlation with {test.against} (grey: not tested)"
    assert len(named) <= 46, "a phone cuts it"
    assert (own.title.text, cross.title.text) == ("autocorrelation", named)
    # A name that is longer than the axis would be cut off beside it.
    assert labels(own) == labels(cross) == ("lag [samples]", "correlation [-]")
    np.testing.assert_allclose(columns(own)["y"], test.autocorrelation)
    np.testing.assert_allclose(columns(cross)["high"], test.cross_correlation_band)
    # Feedback correlates the command with past residuals: a verdict of the other lags must not look like one of these.
    grey = np.array([colour == LIGHT.band for colour in columns(cross)["colour"]])
    np.testing.assert_array_equal(grey, test.cross_lag <= 0)
    undecided = residual_figures(replace(test, cross_p=float("nan")))[1]
    assert set(columns(undecided)["colour"]) == {LIGHT.band}


def test_the_evidence_has_a_line_for_each_effect_its_threshold_and_marks_what_is_decided():
    lines = {"slip@motor": (1.0, 2.0), "dead_zone@input": (4.0, 12.0)} | {
        f"cogging@load{index}": (-1.0, -float(index)) for index in range(MOST)
    }
    plot = evidence_figure((5.0, 10.0), lines, 7.9, {"dead_zone@input": Decided(10.0, 1000, 12.0)}, DARK)
    assert labels(plot) == ("new samples [s]", "log E [-]")
    (span,) = plot.select(Span)
    assert (span.location, span.dimension) == (7.9, "width")
    marks = [one.data_source.data for one in plot.renderers if one.name == "decided"]
    assert [(one["x"], one["y"], one["samples"]) for one in marks] == [([10.0], [12.0], [1000])]
    drawn = [one for one in plot.renderers if one.name == "looks"]
    assert len(drawn) == MOST, "those with most evidence"
    assert list(drawn[0].data_source.data["y"]) == [1.0, 2.0]
    assert plot.y_range.start < -1.0
    assert plot.y_range.end > 12.0
    # The key stands in a table: every entry of a legend is built anew for every line that becomes longer.
    assert not list(plot.select(Legend))
    keys = drawn_lines(lines, {})
    assert [keys[name] for name in ("slip@motor", "dead_zone@input", "cogging@load0")] == [0, 1, 2]
    assert len(keys) == MOST


def test_every_figure_of_the_page_has_labelled_axes_and_the_colours_of_its_theme(contents):
    places = page_figures(contents, DARK)
    assert {"ladder", "candidates", "unknown", "overlay-0", "overlay-1", "force-0"} <= set(places)
    assert "effect-coulomb_friction@motor" in places
    assert all(f"where-{name}-{variable}" in places for name, variable in where_places(contents))
    for place, plots in places.items():
        for plot in plots:
            assert plot.background_fill_color == DARK.surface
            for axis in (*plot.below, *plot.left):
                # Only what lists steps or effects has no quantity: its rows are named.
                listed = not axis.visible or (place in {"ladder", "candidates"} and axis in plot.yaxis)
                assert listed or axis.axis_label.endswith("]"), place
    assert LIGHT.surface not in str([plot.border_fill_color for plots in places.values() for plot in plots])


def test_an_effect_that_ties_has_the_bar_of_what_it_explains(contents):
    """As much as the one that was added, in whose place it would do."""
    start, step = contents.ladder.steps
    tied = replace(contents.ladder, steps=(start, replace(step, set=(step.added.name, "input_offset@input"))))
    row = next(one for one in ladder_rows(tied) if one.standing == TIED)
    assert row.explains == pytest.approx(step.added.explains)
    assert row.explains > 0.1
    plot = candidates_figure([row])
    assert columns(plot)["share"][0] == pytest.approx(100.0 * row.explains)
