"""`idloop launch` and `idloop replay` as commands."""

from __future__ import annotations

import json

import pytest
from click.testing import CliRunner

from idloop.cli.verbs.launch import command, parse_arguments
from idloop.cli.verbs.replay import command as replay
from idloop.errors import InputError


def test_without_a_graph_those_there_are_are_listed():
    done = CliRunner().invoke(command, [])
    names = ["arm", "dc_motor", "hidden", "mujoco", "replay", "robot", "torsion", "track"]
    assert [line.split()[0] for line in done.output.splitlines()[2:]] == names
    assert json.loads(CliRunner().invoke(command, ["--json"]).output)["graphs"] == names


def test_arguments_are_listed_with_their_values():
    done = CliRunner().invoke(command, ["torsion", "duration:=5", "--show-args", "--json"])
    rows = {row["name"]: row["value"] for row in json.loads(done.output)["arguments"]}
    assert rows["duration"] == "5"
    assert rows["mode"] == "lockstep"


def test_an_argument_that_must_be_given_is_listed_as_such():
    rows = json.loads(CliRunner().invoke(command, ["replay", "--show-args", "--json"]).output)["arguments"]
    assert {row["name"] for row in rows if row["value"] is None} == {"play"}
    assert "(must be given)" in CliRunner().invoke(command, ["replay", "--show-args"]).output
    assert "play must be given" in str(CliRunner().invoke(command, ["replay"]).exception)


@pytest.mark.parametrize("arguments", [["torsoin"], ["torsion", "duration=5"], ["torsion", "dura:=5"]])
def test_wrong_use_is_an_input_error(arguments):
    done = CliRunner().invoke(command, arguments)
    assert isinstance(done.exception, InputError)
    assert "\n" not in str(done.exception)


def test_values_may_hold_the_sign_itself():
    assert parse_arguments(["a:=b:=c", "d:="]) == {"a": "b:=c", "d": ""}


def test_replay_of_a_missing_bag_is_an_input_error():
    assert isinstance(CliRunner().invoke(replay, ["nowhere"]).exception, InputError)
