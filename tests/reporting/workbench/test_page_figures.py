"""Figures of a browser: each is made once for a finding, on a thread of its own."""

from __future__ import annotations

import asyncio
import threading
from concurrent.futures import ThreadPoolExecutor

import pytest

pytest.importorskip("bokeh", reason="no Bokeh: launch_scripts/test installs it")

from bokeh.document import Document
from fake import FakeSource, ticked

from idloop.reporting.figures.theme import DARK
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


def test_of_two_figures_for_one_place_the_newer_is_shown(monkeypatch):
    """A theme that was changed twice left the ladder in the dark: its older figure was ready last."""
    source = FakeSource()
    source.feed(200)
    page = Page(Document(), source, "light")
    page.look |= {"seen": True, "near": ["ladder"]}
    later = threading.Event()
    ladder = Page._ladder

    def slow(page, snapshot):
        found = ladder(page, snapshot)
        if page.look["theme"] == "light":  # the older one
            later.wait(5.0)
        return found

    monkeypatch.setattr(Page, "_ladder", slow)

    async def both():
        first = asyncio.create_task(page.tick())
        await asyncio.sleep(0)
        assert page._drawn, "it is being made"
        page.look |= {"theme": "dark"}
        await asyncio.wait_for(page.tick(), 5.0)
        later.set()
        await first
        for _ in FIGURES:
            await page.tick()

    with ThreadPoolExecutor(1) as pool:
        pool.submit(asyncio.run, both()).result()
    assert page.roots["ladder"].children[0].background_fill_color == DARK.surface
