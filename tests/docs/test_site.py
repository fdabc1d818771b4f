"""The documentation site builds without a warning, links included, and loads nothing from elsewhere."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
ASSET = re.compile(
    r"<(?:script|img|iframe|source)[^>]*\bsrc=\"(?://|https?:)[^\"]*|<link[^>]*\bhref=\"(?://|https?:)[^\"]*"
)


@pytest.mark.slow
def test_the_site_builds_without_a_warning_and_loads_nothing_from_elsewhere(tmp_path: Path) -> None:
    pytest.importorskip("mkdocs")
    site = tmp_path / "site"
    build = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", site],
        cwd=ROOT, env=os.environ | {"NO_MKDOCS_2_WARNING": "1"}, text=True, check=False,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
    )  # fmt: skip
    assert build.returncode == 0, build.stdout
    pages = {page.relative_to(site).as_posix(): page.read_text(encoding="utf-8") for page in site.rglob("*.html")}
    assert {name: found for name, text in pages.items() if (found := ASSET.findall(text))} == {}
    assert 'id="idloop.refine"' in pages["reference/api.html"]
    assert "--minimum-improvement" in pages["reference/command-line.html"]
    assert "<math" in pages["effects.html"]


def test_every_function_and_result_of_the_interface_is_in_the_reference() -> None:
    import idloop

    page = (ROOT / "docs" / "reference" / "api.md").read_text(encoding="utf-8")
    assert sorted(re.findall(r"^::: idloop\.(\w+)$", page, re.MULTILINE)) == sorted(idloop.__all__)
