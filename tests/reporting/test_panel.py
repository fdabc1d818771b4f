"""The measured range sets the scale of a comparison: strays of a free run leave the frame and are told."""

from __future__ import annotations

import numpy as np
import pytest

from idloop.records import Record
from idloop.reporting.figures.comparison import overlay
from idloop.reporting.panel import Panel, residual_frame, value_frame, widest
from idloop.reporting.plots.comparison import plot_panels

TIME = np.linspace(0.0, 10.0, 1001)
MEASURED = 5.0 * np.sin(TIME)
NEAR = MEASURED + 0.05 * np.cos(7.0 * TIME)


def absurd() -> np.ndarray:
    """A free run whose first velocity is nothing that was ever measured."""
    values = NEAR.copy()
    values[:3] = (-540.0, -40.0, -3.0)
    return values


def test_a_first_sample_that_is_absurd_does_not_set_the_scale():
    frame = value_frame(MEASURED, {"model": absurd()})
    assert -8.0 < frame.low < -5.0
    assert 5.0 < frame.high < 8.0
    assert frame.strays == {"model": "to −540"}
    left = residual_frame(MEASURED, {"model": absurd()}, 0.02)
    assert 0.04 < left.high < 0.2
    assert left.low == -left.high
    assert left.strays == {"model": "to 540"}


def test_a_run_that_drifts_away_is_cut_off_at_the_width_of_what_was_measured():
    frame = value_frame(MEASURED, {"near": NEAR, "gone": MEASURED + 30.0 * TIME})
    assert 15.0 < frame.high < 18.0
    assert list(frame.strays) == ["gone"]
    left = residual_frame(MEASURED, {"near": NEAR, "gone": MEASURED + 30.0 * TIME})
    # What the better one leaves is still seen beside it, and the legend says how far the other goes.
    assert left.high == pytest.approx(1.06 * 8.0 * 0.05, rel=0.01)
    assert left.strays == {"gone": "to 300"}
    alone = residual_frame(MEASURED, {"gone": MEASURED + 30.0 * TIME})
    assert alone.high == pytest.approx(1.06 * 2.0 * np.ptp(MEASURED))


def test_what_stays_near_is_not_touched():
    frames = [value_frame(MEASURED, {"near": NEAR}), value_frame(MEASURED, {"far": 2.5 * MEASURED})]
    assert [frame.cut for frame in frames] == [False, False]
    assert widest(frames) is None
    assert residual_frame(MEASURED, {"near": NEAR}).high == pytest.approx(1.06 * 0.05, rel=0.01)


@pytest.mark.parametrize("measured", (np.full(1001, np.nan), np.ones(1001)))
def test_what_never_changes_sets_no_scale(measured):
    assert value_frame(measured, {"model": absurd()}) is None
    assert residual_frame(measured, {"model": absurd()}) is None


def test_linked_axes_have_one_frame():
    cut, whole = value_frame(MEASURED, {"a": absurd()}), value_frame(3.0 * MEASURED, {"a": 3.0 * NEAR})
    both = widest([cut, whole])
    assert (both.low, both.high) == (whole.low, whole.high)
    assert widest([cut, None]) is None


def panel(modelled: np.ndarray) -> Panel:
    measured, names, units = MEASURED[:, None], ("motor.velocity",), ("rad/s",)
    record = Record("train", TIME, np.sign(MEASURED), TIME, measured, "motor.effort", "V", names, units)
    notes = {"model": ["FIT 96 %"]}
    return Panel("train", record, TIME, measured, {"model": modelled[:, None]}, np.array([0.02]), notes)


def test_both_figures_keep_the_measured_scale_and_say_how_far_the_model_goes():
    figure = plot_panels([panel(absurd())])
    top, below = figure.axes[:2]
    assert -8.0 < top.get_ylim()[0] < top.get_ylim()[1] < 8.0
    assert below.get_ylim()[1] < 0.2
    assert [text.get_text() for text in top.get_legend().get_texts()][
        1
    ] == "model (FIT 96 %; leaves the frame, to −540)"
    drawn = overlay(panel(absurd()))
    assert -8.0 < drawn[0].y_range.start < drawn[0].y_range.end < 8.0
    assert drawn[1].y_range.end < 0.2


def test_figures_of_models_that_stay_near_find_their_own_scale():
    figure = plot_panels([panel(NEAR)])
    assert figure.axes[0].get_autoscaley_on()
    assert type(overlay(panel(NEAR))[0].y_range).__name__ == ("DataRange1d")
