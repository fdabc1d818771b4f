"""Spelling, and words that a document or a message must not use, with the word to use."""

from __future__ import annotations

import ast
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
GENERATED = {"nodes.md", "effects.md", "controllers.md"}  # their words stand in src and ros_ws
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
SOURCES = [*sorted((ROOT / "src" / "idloop").rglob("*.py")), *sorted((ROOT / "ros_ws" / "src").rglob("*.py"))]

# What must not be written, and the field's term for it.
INSTEAD = {
    r"told": "given, reported, identified, or the applied command",
    r"foretells?": "predicts; the Granger test",
    r"footing": "common noise model",
    r"unevenness": "heteroscedasticity",
    r"lattice": "quantisation",
    r"twins?": "equivalent effects, or a duplicate node",
    r"stand(?:s|ing)? in for": "is confounded with",
    r"stand-ins?": "confounding",
    r"its word|last word": "the last message",
    r"hears?|speaks?": "receives, publishes, communicates",
    r"bears? out|borne out|bears?": "confirms, supports",
    r"lens": "reference observer",
    r"may stand at": "may act at",
    r"looking behind": "estimating under",
    r"leaps?": "non-nested search",
    r"speedometer": "velocity estimator",
}
# Misspelt on purpose: what a test gives to a message that offers the right name.
ON_PURPOSE = "amplitud,colum,comand,efort,feld,frequncy,laod,modle,nam,ofset,positon,postion,sise,thta,valeu,widht"


def _prose(text: str) -> str:
    """Return a page without its code."""
    return re.sub(r"`[^`\n]*`", "", re.sub(r"^```.*?^```$", "", text, flags=re.DOTALL | re.MULTILINE))


def _texts(node: ast.AST) -> Iterator[str]:
    for part in ast.walk(node):
        if isinstance(part, ast.Constant) and isinstance(part.value, str):
            yield part.value


def _messages(source: str) -> Iterator[str]:
    """Yield what a user reads of a module: errors, and the help of commands and options."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Raise) and node.exc is not None:
            yield from _texts(node.exc)
        elif isinstance(node, ast.keyword) and node.arg in {"help", "short_help", "epilog"}:
            yield from _texts(node.value)


def _found(texts: Iterator[str] | list[str]) -> list[str]:
    return [
        f"'{match[0]}' in \"{' '.join(text.split())[:90]}\": write {better}"
        for text in texts
        for word, better in INSTEAD.items()
        for match in re.finditer(rf"\b(?:{word})\b", text, re.IGNORECASE)
    ]


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_a_page_uses_the_words_of_the_field(page: Path) -> None:
    if page.name in GENERATED:
        pytest.skip("generated: its words are checked where they are written")
    lines = _prose(page.read_text(encoding="utf-8")).splitlines()
    assert _found(lines) == []


def test_messages_use_the_words_of_the_field() -> None:
    found = {
        path.relative_to(ROOT).as_posix(): wrong
        for path in SOURCES
        if (wrong := _found(list(_messages(path.read_text(encoding="utf-8")))))
    }
    assert found == {}


@pytest.mark.parametrize("folder", ["src", "ros_ws/src", "docs", "examples", "benchmarks", "launch_scripts", "tests"])
def test_words_are_spelt_right(folder: str) -> None:
    if shutil.which("codespell", path=Path(sys.executable).parent) is None:
        pytest.skip("no codespell in this environment")
    command = [sys.executable, "-m", "codespell_lib", folder, "README.md", "CONTRIBUTING.md", "--skip", "*.png,*.lock"]
    if folder == "tests":
        command += ["--ignore-words-list", ON_PURPOSE + ",ba,hist,nd,fro,informations,numer,wit"]
    run = subprocess.run(command, cwd=ROOT, text=True, check=False, capture_output=True)
    assert run.stdout == ""
