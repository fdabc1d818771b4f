"""The public API: every name is there, documented with an example that runs, and imported on first use only."""

from __future__ import annotations

import doctest
import inspect
import subprocess
import sys

import pytest

import idloop

CALLABLES = [name for name in idloop.__all__ if inspect.isfunction(getattr(idloop, name))]


@pytest.mark.parametrize("name", idloop.__all__)
def test_every_name_is_there_and_documented(name):
    one = getattr(idloop, name)
    assert inspect.getdoc(one)
    assert name in dir(idloop)


@pytest.mark.parametrize("name", CALLABLES)
def test_every_argument_is_documented(name):
    text = inspect.getdoc(getattr(idloop, name))
    for argument, parameter in inspect.signature(getattr(idloop, name)).parameters.items():
        stars = {parameter.VAR_POSITIONAL: "*", parameter.VAR_KEYWORD: "**"}.get(parameter.kind, "")
        assert f"{stars}{argument}" in text, argument


def test_a_name_that_is_not_there_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'fitt'"):
        _ = idloop.fitt


def test_the_import_is_light():
    heavy = ("numpy", "scipy", "numba", "control", "matplotlib")
    script = f"import sys, idloop; print([m for m in {heavy} if m in sys.modules])"
    out = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert out.stdout.strip() == "[]"


@pytest.mark.parametrize(
    "name",
    [name for name in idloop.__all__ if ">>>" in (inspect.getdoc(getattr(idloop, name)) or "")]
    + ["Record.from_arrays", "Record.from_frame"],
)
def test_every_example_runs_as_it_stands(name):
    one = idloop
    for part in name.split("."):
        one = getattr(one, part)
    found = doctest.DocTestFinder(recurse=False).find(one, name)
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS)
    for example in found:
        runner.run(example)
    assert runner.summarize(verbose=False).attempted > 0
    assert runner.summarize(verbose=False).failed == 0
