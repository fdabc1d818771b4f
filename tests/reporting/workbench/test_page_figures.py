"""Figures of a browser: each is made once for a finding, on a thread of its own."""

from __future__ import annotations

import asyncio

import pytest

pytest.importorskip("bokeh", reason="no Bokeh: launch_scripts/test installs it")

from bokeh.document import Document
from fake import FakeSource, ticked

from idloop.reporting.workbench.page import FIGURES, Page


@pytest.mark.parametrize(
    ("live", "look", "seen"),
    [
        (True, {"seen": True, "near": ["ladder"]}, True),
        (True, {"seen": True, "near": ["where"]}, False),
        (False, {"seen": True, "near": []}, True),
        (True, {"seen": False, "near": ["ladder"]}, False),
    ],
)
def test_figures_are_made_beside_the_thread_that_answers_the_strips(live, look, seen, monkeypatch):
    source = FakeSource(live=live)
    source.feed(200)
    made = []
    ladder = Page._ladder

    def noted(page, snapshot):
        made.append(asyncio._get_running_loop())
        return ladder(page, snapshot)

    monkeypatch.setattr(Page, "_ladder", noted)
    page = Page(Document(), source, "light")
    page.look |= look
    for _ in range(2 * len(FIGURES)):
        ticked(page)
    assert len(made) == seen, "once for a finding, and never for a page in the background or, live, out of sight"
    assert not any(made), "no loop runs on the thread that makes it"
    assert bool(page.roots["ladder"].children) == seen
