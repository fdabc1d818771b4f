"""Takes a picture of the workbench in headless Chromium.

.venv/bin/python docs/workbench_picture.py ADDRESS FILE
"""

from __future__ import annotations

import argparse
import os
import shutil
from pathlib import Path
from typing import Any

from idloop.errors import IdloopError

ARGUMENTS = ("--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-component-update")
LONG = 900_000  # milliseconds that a diagnosis may take
ADD = "#candidates .card.significant button.primary"
_LOOKS = "() => document.body.dataset.looks"
_STEPS = "() => document.querySelector('#steps').textContent"
_BESIDE = """folder => { for (const one of document.querySelectorAll("#commands code"))
  if (folder) one.textContent = one.textContent.replaceAll(`${folder}/`, ""); }"""
_REFUSED = "() => document.querySelector('#note.bad:not([hidden]) span')?.textContent ?? ''"


def take_picture(
    address: str, file: Path, *, add: int = 0, dark: bool = False, width: int = 1500, folder: str = ""
) -> None:
    """Find what is missing, add it as often as wanted, find what is missing then, and take the picture.

    `folder`: of the files, without which the commands of the page name them.
    Raises IdloopError: the workbench could not do what was asked.
    """
    from playwright.sync_api import Error, sync_playwright

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
        try:
            page.goto(address)
        except Error as error:
            raise IdloopError(f"no workbench answers at {address}: {str(error).splitlines()[0]}") from error
        page.wait_for_selector("body[data-ready]")
        page.wait_for_selector("#stretches > *")
        if page.is_visible("#stop"):
            page.wait_for_selector(".fit .what >> text=unseen data")
        climb(page, add)
        if page.is_visible("#assess"):
            _leave_alone(page)
        page.wait_for_function("() => !document.querySelector('#candidates').textContent.includes('is being drawn')")
        page.evaluate("() => scrollTo(0, document.body.scrollHeight)")  # a live graph draws the figures that came near
        page.wait_for_timeout(3000)
        page.mouse.move(0, 0)
        page.evaluate("() => { scrollTo(0, 0); strips.whole(); }")
        page.evaluate(_BESIDE, folder)
        page.screenshot(path=file, full_page=True)
        browser.close()


def climb(page: Any, add: int) -> None:
    """Find what is missing and add it, as often as asked, then look again; IdloopError where that is refused."""
    _diagnose(page)
    for _ in range(add):
        if not page.is_visible(ADD):
            return
        # One that takes the place of another makes the ladder no longer.
        _order(page, ADD, _STEPS)
        _diagnose(page)


def _diagnose(page: Any) -> None:
    _order(page, "#diagnose", _LOOKS)  # one that is over at once shows no activity


def _order(page: Any, button: str, shown: str) -> None:
    """Click, and wait until what is shown has changed and nothing is under way."""
    before = page.evaluate(shown)
    page.click(button)
    page.wait_for_function(f"before => ({shown})() !== before || ({_REFUSED})() !== ''", arg=before)
    page.wait_for_selector("#activity", state="hidden")
    if page.evaluate(shown) == before:
        raise IdloopError(f"the workbench says: {page.evaluate(_REFUSED)}")


def _leave_alone(page: Any) -> None:
    """Show the free run over the newest data: one step ahead, even a poor model looks good."""
    page.select_option("#span", "20")
    page.select_option("#shown", "free_run")
    before = page.inner_text("#where-hint")
    page.click("#assess")
    page.wait_for_function("text => document.querySelector('#where-hint').innerText !== text", arg=before)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("address")
    parser.add_argument("file", type=Path)
    parser.add_argument("--add", type=int, default=0, help="effects that are added before the picture is taken")
    parser.add_argument("--dark", action="store_true")
    given = parser.parse_args()
    try:
        take_picture(given.address, given.file, add=given.add, dark=given.dark)
    except IdloopError as error:
        parser.exit(1, f"{error}\n")
