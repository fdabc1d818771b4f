"""A page as PDF or as a picture, by the Chromium (or Chrome, or Edge) that is installed."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from pathlib import Path

from idloop.errors import IdloopError, InputError

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome", "microsoft-edge")
VARIABLE = "IDLOOP_CHROMIUM"
# Long enough for the figures of a large page on a slow machine [s, ms of the page's own clock].
_PATIENCE, _PAGE_TIME = 180, 60_000


def find_chromium() -> str:
    """Path of a browser that can print; InputError where there is none."""
    named = os.environ.get(VARIABLE)
    for name in [named] if named else NAMES:
        found = shutil.which(name)
        if found:
            return found
    raise InputError(
        f"no {named or 'Chromium'} for a PDF or a picture: install chromium, name it in {VARIABLE}, "
        "or print the page yourself"
    )


def print_pdf(page: Path, target: Path) -> Path:
    """Print an HTML file that needs no network as PDF.

    Raises InputError: there is no browser.
    Raises IdloopError: it fails.
    """
    # As wide as the paper, so that the figures have its width; doubled for sharp pictures.
    return _run(page, target, "--window-size=820,1160", "--force-device-scale-factor=2", "--no-pdf-header-footer",
                f"--print-to-pdf={target.resolve()}")  # fmt: skip


def take_picture(page: Path, target: Path, width: int = 1280, height: int = 1620) -> Path:
    """Take a PNG of the upper part of a page in a window of a size [CSS pixels]; raises as `print_pdf`."""
    return _run(page, target, f"--window-size={width},{height}", f"--screenshot={target.resolve()}")


def _run(page: Path, target: Path, *wishes: str) -> Path:
    """Start the browser, let it write the target, and see that it did."""
    browser = find_chromium()
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        command = [
            browser, "--headless", "--disable-gpu", "--no-first-run", "--disable-background-networking",
            "--disable-component-update", "--disable-sync", "--disable-quic", "--hide-scrollbars",
            f"--user-data-dir={profile}", f"--virtual-time-budget={_PAGE_TIME}", *wishes,
        ]  # fmt: skip
        # Chromium's sandbox refuses to run for root; the page is ours and loads nothing.
        if hasattr(os, "geteuid") and os.geteuid() == 0:
            command.append("--no-sandbox")
        target.unlink(missing_ok=True)
        try:
            done = subprocess.run(  # noqa: S603
                [*command, page.resolve().as_uri()], capture_output=True, text=True, timeout=_PATIENCE, check=False
            )
        except (OSError, subprocess.TimeoutExpired) as error:
            raise IdloopError(f"{browser} could not print {page}: {error}") from error
    if not target.is_file():
        last = (done.stderr.strip().splitlines() or ["no reason given"])[-1]
        raise IdloopError(f"{browser} could not print {page}: {last}")
    return target
