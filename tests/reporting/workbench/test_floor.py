"""The line of what noise alone leaves: drawn under the ladder until a step goes below it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("bokeh", reason="no Bokeh: launch_scripts/test installs it")

from bokeh.document import Document
from fake import FRICTION, FakeSource, ticked

from idloop.diagnosis import Ladder
from idloop.reporting.workbench.page import Page, judged_spread


def floors(page):
    """Where the noise of each output is drawn in the figures of the ladder."""
    drawn = (one.data_source.data for plot in page.roots["ladder"].children for one in plot.renderers)
    return [float(data["x"][0]) for data in drawn if "high" in data]


def seen(source):
    """The page of a browser that looks at it."""
    page = Page(Document(), source, "light")
    page.look |= {"seen": True, "near": ["ladder"]}
    draw(page)
    return page


def draw(page):
    for _ in page.roots:
        ticked(page)


def test_a_floor_that_the_ladder_goes_below_is_none():
    source = FakeSource()
    source.feed(3000)
    page = seen(source)
    assert len(floors(page)) == 2
    source.signals.noise[:] = 0.7, 0.02  # of a motion of about 0.7: the position was said to be all noise
    source.order("add", FRICTION.name)  # and is known to 2 %
    draw(page)
    assert len(floors(page)) == 1


def test_data_with_a_larger_motion_do_not_refute_the_noise():
    source = FakeSource()
    source.feed(3000)
    start = source.state.snapshot.ladder.steps[0]
    # One noise of 0.001 rad, on an unseen motion of 3.3 rad and a fitted one of 5 rad.
    errors = ({"nrmse": {"motor.position": 0.001 / spread}, "rmse": {"motor.position": 0.001}} for spread in (3.3, 5.0))
    unseen, fitted = errors
    source.signals.noise[:] = 0.001, np.nan
    source.state.change(ladder=Ladder((replace(start, validation=unseen, train=fitted),)))
    (drawn,) = floors(seen(source))
    assert drawn == pytest.approx(0.001 / 3.3)


def test_the_floor_is_that_of_the_data_that_judge_the_ladder():
    source = FakeSource()
    source.feed(3000)
    start = source.state.snapshot.ladder.steps[0]
    # Judged on a motion of 4 rad; what is shown meanwhile is one of about 0.7.
    judged = {"nrmse": {"motor.position": 0.2, "motor.velocity": 0.4}, "rmse": {"motor.position": 0.8}}
    ladder = Ladder((replace(start, validation=judged),))
    assert judged_spread(ladder, "motor.position") == pytest.approx(4.0)
    assert judged_spread(ladder, "motor.velocity") == 0.0
    source.signals.noise[:] = 0.04, 0.02
    source.state.change(ladder=ladder)
    page = seen(source)
    drawn = floors(page)
    assert min(drawn) == pytest.approx(0.01)
    assert max(drawn) == pytest.approx(0.02 / 0.7, rel=0.1)
