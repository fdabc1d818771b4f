"""An experiment and its rivals survive the file: the report draws what `suggest` computed."""

from __future__ import annotations

import json

import numpy as np
import pytest

from idloop.diagnosis.design.expected_outcome import Outcome
from idloop.diagnosis.design.suggest import Limits, Suggestion
from idloop.physics import load_model
from idloop.reporting.experiment_rows import rows_of
from idloop.reporting.figures.next_experiment import experiment_figures
from idloop.reporting.next_experiment import next_document, read_next


@pytest.fixture(scope="module")
def suggestion() -> Suggestion:
    motor = load_model("dc_motor")
    rivals = tuple(
        (name, motor.with_effects([text]))
        for name, text in (
            ("friction", "coulomb_friction@motor(level=2)"),
            ("dead zone", "dead_zone@input(width=0.25)"),
        )
    )
    signal = {"name": "triangle", "sample_time": 0.01, "duration": 4.0, "amplitude": 1.0, "frequency": 0.5}
    outcomes = tuple(Outcome(name, 40.0, "the other", {}, f"if {name}: it leads") for name, _ in rivals)
    limits = Limits(command=2.0, position=(-20.0, 20.0))
    return Suggestion(
        signal, "command", 4.0, 40.0, outcomes, "expected to tell them apart", limits, 0.0, None, 0.01, rivals,
        (0.002, 0.01),
    )  # fmt: skip


def test_it_is_read_as_it_was_written(suggestion):
    read = read_next(json.loads(json.dumps(next_document(suggestion))))
    assert read.to_dict() == suggestion.to_dict()
    assert read.limits == suggestion.limits
    assert [label for label, _ in read.rivals] == ["friction", "dead zone"]
    for one, other in zip(rows_of(read), rows_of(suggestion), strict=True):
        assert one.label == other.label
        for a, b in zip(one.curves, other.curves, strict=True):
            np.testing.assert_array_equal(a.value, b.value)


def test_the_figure_shows_what_is_sent_and_what_each_rival_would_show(suggestion):
    plots = experiment_figures(suggestion)
    rows = rows_of(suggestion)
    assert [plot.yaxis[0].axis_label for plot in plots] == [row.label for row in rows]
    assert len({plot.x_range.id for plot in plots}) == 1
    for plot, row in zip(plots, rows, strict=True):
        for drawn, curve in zip(plot.renderers, row.curves, strict=True):
            np.testing.assert_allclose(drawn.data_source.data["y"], curve.value, rtol=1e-5, atol=1e-6)
    named = [plot for plot in plots if plot.above]
    assert [item.label["value"] for item in named[0].above[0].items] == [
        "friction (leads by 40 if right)",
        "dead zone (leads by 40 if right)",
    ]
    titles = {row.kind: plot.title.text for plot, row in zip(plots, rows, strict=True)}
    assert titles["difference"].startswith("from friction")
    assert "friction" not in titles["output"]
