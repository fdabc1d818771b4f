"""The command line is written so that a shell understands it again."""

from __future__ import annotations

import shlex

import click
import pytest

from idloop.cli._command_line import command_line


def keep(context: click.Context, parameter: click.Parameter, value: tuple[str, ...]) -> None:
    context.meta[f"idloop.{parameter.name}"] = value


@click.command()
@click.argument("bags", nargs=-1)
@click.option("--validate", multiple=True)
@click.option("--level", type=float, default=0.01)
@click.option("--limits", type=(float, float))
@click.option("--undo", count=True)
@click.option("--force", is_flag=True)
@click.option("--quiet", is_flag=True, expose_value=False)
@click.option("--joint", multiple=True, expose_value=False, callback=keep)
@click.pass_context
def verb(context: click.Context, **_: object) -> str:
    return command_line(context)


@pytest.mark.parametrize(
    "words",
    (
        [],
        ["one", "two"],
        ["a folder/bag's", "--level", "0.05"],
        ["one", "--validate", "x", "--validate", "y z", "--limits", "-1.0", "2.5", "--undo"],
        ["one", "--undo", "--undo", "--force", "--quiet"],
        ["one", "--joint", "axis=elbow", "--joint", "a=b"],
    ),
)
def test_it_comes_back_as_it_was_given(words):
    text = verb.main(words, prog_name="refine", standalone_mode=False)
    assert shlex.split(text) == ["idloop", "refine", *words]


def test_defaults_are_left_out():
    assert verb.main(["one"], prog_name="refine", standalone_mode=False) == "idloop refine one"


def test_what_is_known_is_left_out_and_what_is_new_comes_first():
    with verb.make_context("refine", ["one", "--level", "0.05", "--undo"]) as context:
        line = command_line(context, without=("bags", "undo"), with_=("--resume", "a folder"))
    assert line == "idloop refine --resume 'a folder' --level 0.05"
