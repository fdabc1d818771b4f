"""Commands that are printed begin as the user has called the program."""

from __future__ import annotations

import sys

import pytest

from idloop.called_as import program


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """A program in a folder of its own, which is the current one's neighbour and in no search path."""
    script = tmp_path / "env" / "bin" / "idloop"
    script.parent.mkdir(parents=True)
    script.write_text("#!/bin/sh\n")
    script.chmod(0o755)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PATH", str(tmp_path))
    return script


def test_a_path_by_which_it_was_called_is_kept(installed, monkeypatch):
    monkeypatch.setattr(sys, "argv", ["env/bin/idloop", "start"])
    assert program() == "env/bin/idloop"


def test_a_path_with_a_blank_is_quoted(installed, monkeypatch, tmp_path):
    (tmp_path / "my env").mkdir()
    (tmp_path / "my env" / "idloop").write_text("")
    monkeypatch.setattr(sys, "argv", ["my env/idloop"])
    assert program() == "'my env/idloop'"


def test_a_program_of_the_current_folder_is_not_found_by_its_name(installed, monkeypatch):
    monkeypatch.chdir(installed.parent)
    monkeypatch.setattr(sys, "argv", ["./idloop"])
    assert program() == "./idloop"


def test_what_the_shell_finds_needs_no_path(installed, monkeypatch):
    monkeypatch.setenv("PATH", str(installed.parent))
    monkeypatch.setattr(sys, "argv", [str(installed)])
    assert program() == "idloop"


def test_another_program_that_the_shell_finds_is_not_meant(installed, monkeypatch, tmp_path):
    other = tmp_path / "idloop"
    other.write_text("")
    other.chmod(0o755)
    monkeypatch.setattr(sys, "argv", [str(installed)])
    assert program() == str(installed)


@pytest.mark.parametrize("argv", [[], [""], ["python"], ["/usr/bin/pytest"], ["idloop"], ["gone/idloop"]])
def test_otherwise_the_name_is_enough(installed, monkeypatch, argv):
    monkeypatch.setattr(sys, "argv", argv)
    assert program() == "idloop"
