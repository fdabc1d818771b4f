"""Imports go one way: between packages by the contract in pyproject.toml, within each of them file by file."""

from __future__ import annotations

import ast
from graphlib import TopologicalSorter
from pathlib import Path

import pytest
from importlinter import cli

import idloop

CONFIGURATION = Path(__file__).parents[1] / "pyproject.toml"
ROOT = Path(idloop.__file__).parent
PACKAGES = sorted(folder.name for folder in ROOT.iterdir() if (folder / "__init__.py").is_file())
# A model writes its own file and travels to other processes as its text.
ALLOWED = {("physics.model", "physics.model_file")}


def test_no_package_imports_one_above_it(capsys: pytest.CaptureFixture[str]) -> None:
    code = cli.lint_imports(config_filename=str(CONFIGURATION), no_cache=True)
    assert code == cli.EXIT_STATUS_SUCCESS, capsys.readouterr().out


def imported(file: Path) -> set[str]:
    """Modules of idloop that a file imports, anywhere in it, annotations included."""
    found = set()
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("idloop."):
            module = str(node.module).removeprefix("idloop.")
            found |= {module, *(f"{module}.{one.name}" for one in node.names)}
    return found


@pytest.mark.parametrize("package", PACKAGES)
def test_no_file_of_a_package_leads_back_to_itself(package: str) -> None:
    graph = {}
    for file in (ROOT / package).rglob("*.py"):
        # What a package offers is imported by others, not by its own files.
        if file.name != "__init__.py":
            name = ".".join(file.relative_to(ROOT).with_suffix("").parts)
            graph[name] = {one for one in imported(file) if (name, one) not in ALLOWED}
    list(TopologicalSorter(graph).static_order())
