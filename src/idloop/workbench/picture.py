"""``python -m idloop.workbench.picture ADDRESS FILE``: a picture of the page, as headless Chromium shows it."""

from __future__ import annotations

import argparse
import os
import shutil
from pathlib import Path
from typing import Any

ARGUMENTS = ("--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-component-update")
LONG = 900_000  # milliseconds that a diagnosis may take


def take_picture(address: str, file: Path, *, add: int = 0, dark: bool = False, width: int = 1500) -> None:
    """Find what is missing, add it as often as wanted, find what is missing then, and take the picture.

    Parameters
    ----------
    address : str
        Of a page.
    file : Path
        PNG to write.
    add : int
        Effects that are added before.
    dark : bool
        In the dark.
    width : int
        Of the page [CSS pixels].
    """
    from playwright.sync_api import sync_playwright

    with sync_playwright() as driver:
        browser = driver.chromium.launch(
            executable_path=os.environ.get("IDLOOP_CHROMIUM") or shutil.which("chromium"), args=list(ARGUMENTS)
        )
        page = browser.new_page(
            viewport={"width": width, "height": 1000},
            color_scheme="dark" if dark else "light",
            device_scale_factor=1.25,
        )
        page.set_default_timeout(LONG)
        page.goto(address)
        page.wait_for_selector("body[data-ready]")
        page.wait_for_selector("#stretches button")
        if page.is_visible("#stop"):
            page.wait_for_selector(".fit .what >> text=unseen data")
        for step in range(add + 1):
            _diagnose(page)
            if step < add:
                page.click("#candidates .card.significant button.primary")
                page.wait_for_selector(f"[data-step='{step + 1}']")
                page.wait_for_selector("#activity", state="hidden")
        if page.is_visible("#assess"):
            _leave_alone(page)
        page.wait_for_timeout(1500)  # what was found is drawn
        page.mouse.move(0, 0)
        page.evaluate("() => { scrollTo(0, 0); strips.paint(performance.now(), true); }")
        page.screenshot(path=file, full_page=True)
        browser.close()


def _diagnose(page: Any) -> None:
    before = page.get_attribute("body", "data-looks")
    page.click("#diagnose")
    page.wait_for_selector(f"body:not([data-looks='{before}'])")  # one that is over at once shows no activity
    page.wait_for_selector("#activity", state="hidden")
    page.wait_for_selector("#candidates > *, .verdict.good", state="attached")


def _leave_alone(page: Any) -> None:
    """Show the free run over the newest data: one step ahead, even a poor model looks good."""
    page.select_option("#span", "20")
    page.select_option("#shown", "free_run")
    before = page.inner_text("#where-hint")
    page.click("#assess")
    page.wait_for_function("text => document.querySelector('#where-hint').innerText !== text", arg=before)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("address")
    parser.add_argument("file", type=Path)
    parser.add_argument("--add", type=int, default=0, help="effects that are added before the picture is taken")
    parser.add_argument("--dark", action="store_true")
    given = parser.parse_args()
    take_picture(given.address, given.file, add=given.add, dark=given.dark)
