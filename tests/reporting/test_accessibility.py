"""Workbench and report by axe-core, wide and on a phone, light and dark."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

pytest.importorskip("bokeh", reason="no Bokeh: launch_scripts/test installs it")
pytest.importorskip("axe_playwright_python", reason="no axe-core: launch_scripts/test installs it")

from axe_playwright_python.sync_playwright import Axe

from idloop.reporting.ladder_folder import write_report

LOOKS = [(1400, "light"), (390, "dark")]


def violations(page) -> list[str]:
    """Rule and first part of the page of everything that axe-core finds."""
    found = Axe().run(page).response["violations"]
    return [f"{one['id']}: {one['nodes'][0]['html'][:200]}" for one in found]


@pytest.fixture(scope="module")
def addresses(contents, tmp_path_factory):
    """Of a page and of a report."""
    sys.path.insert(0, str(Path(__file__).parent / "workbench"))
    from fake import FakeSource

    from idloop.reporting.workbench.server import Place, Site

    report = tmp_path_factory.mktemp("report") / "report.html"
    write_report(contents, report)
    source = FakeSource()
    source.feed(3000)
    site = Site(source, Place())
    yield {"workbench": site.address, "report": report.as_uri()}
    site.close()
    source.close()


@pytest.mark.slow
@pytest.mark.parametrize(("width", "scheme"), LOOKS)
@pytest.mark.parametrize("which", ["workbench", "report"])
def test_a_page_can_be_used_by_everybody_and_nothing_is_cut_off(browser, addresses, which, width, scheme):
    context = browser.new_context(viewport={"width": width, "height": 900}, color_scheme=scheme, bypass_csp=True)
    page = context.new_page()
    try:
        page.goto(addresses[which])
        page.wait_for_selector("body[data-ready]" if which == "workbench" else "figure.plot .bk-Figure")
        assert violations(page) == []
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        # A figure is as wide as its place at most: the ladder is not cut off on a phone.
        wide = page.evaluate(
            "() => [...document.querySelectorAll('figure.plot, [data-root-id]')].filter((one) =>"
            " [...one.children].some((child) => child.getBoundingClientRect().right > innerWidth + 1)).length"
        )
        assert wide == 0
    finally:
        context.close()
