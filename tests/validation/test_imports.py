"""Files import one another in one direction, annotations included."""

from __future__ import annotations

import ast
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import idloop

ROOT = Path(idloop.__file__).parent


def imported(file: Path, package: str) -> set[str]:
    """Files of a package that a file of it imports, anywhere in it."""
    found = set()
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith(f"idloop.{package}"):
            found.add(str(node.module).removeprefix("idloop."))
    return found


@pytest.mark.parametrize("package", ["validate", "report", "workbench"])
def test_no_file_leads_back_to_itself(package: str) -> None:
    graph = {}
    for file in (ROOT / package).rglob("*.py"):
        name = ".".join(file.relative_to(ROOT).with_suffix("").parts)
        # What a package hands on is imported by others, not by its own files.
        if file.name != "__init__.py":
            graph[name] = imported(file, package)
    list(TopologicalSorter(graph).static_order())
