"""The line of what noise alone leaves: drawn under the ladder until a step goes below it."""

from __future__ import annotations

import pytest

pytest.importorskip("bokeh", reason="no Bokeh: launch_scripts/test installs it")

from bokeh.document import Document
from bokeh.models import Span
from fake import FRICTION, FakeSource

from idloop.workbench.page import Page


def floors(page):
    """Number of the lines of noise in the figure of the ladder."""
    return sum(isinstance(one, Span) for plot in page.roots["ladder"].children for one in plot.center)


def test_a_floor_that_the_ladder_goes_below_is_none():
    source = FakeSource()
    source.feed(3000)
    page = Page(Document(), source, "light")
    assert floors(page) == 2
    source.signals.noise[:] = 0.7, 0.02  # of a motion of about 0.7: the position was said to be all noise
    source.order("add", FRICTION.name)  # and is known to 2 %
    page.tick()
    assert floors(page) == 1
