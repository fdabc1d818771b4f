"""Imports go one way: the contract stands in pyproject.toml, under [tool.importlinter]."""

from pathlib import Path

import pytest
from importlinter import cli

CONFIGURATION = Path(__file__).parents[1] / "pyproject.toml"


def test_no_package_imports_one_above_it(capsys: pytest.CaptureFixture[str]) -> None:
    code = cli.lint_imports(config_filename=str(CONFIGURATION), no_cache=True)
    assert code == cli.EXIT_STATUS_SUCCESS, capsys.readouterr().out
