"""The YAML launch files as our runner reads them."""

from __future__ import annotations

import re

import pytest

from idloop.errors import InputError
from idloop.graph import graph_names, graph_summary, load_graph
from idloop.graph.command import parameter_document
from idloop.graph.find import package_share

LAUNCH = """
launch:
  - arg: {name: speed, default: "3", description: "how fast"}
  - arg: {name: label, description: "must be given"}
  - arg: {name: extra, default: "false"}
  - let: {name: full, value: "$(var label)_$(var speed)"}
  - node:
      pkg: demo
      exec: talker
      name: $(var full)
      namespace: left
      on_exit: shutdown
      args: --quiet
      param:
        - from: $(dirname)/talker.yaml
        - {name: speed, value: $(var speed)}
        - {name: list, value: "['a', 'b']"}
        - {name: text, value: "'3'"}
        - {name: empty, value: "''"}
        - {name: law, value: "{type: pd, kp: $(var speed)}", type: str}
        - {name: home, value: $(env IDLOOP_NOT_SET nowhere)}
        - {name: side_by_side, value: $(var speed)/$(env IDLOOP_NOT_SET nowhere)}
        - {name: nested, value: [$(var speed), 1.5]}
      remap:
        - {from: chatter, to: /words}
  - node: {pkg: demo, exec: listener, if: $(var extra)}
"""


@pytest.fixture
def launch_file(tmp_path):
    path = tmp_path / "demo.launch.yaml"
    path.write_text(LAUNCH)
    return path


def test_a_launch_file_is_read_as_ros_reads_it(launch_file):
    graph = load_graph(str(launch_file), {"label": "one"})
    assert graph.name == "demo"
    (node,) = graph.nodes
    assert (node.package, node.executable, node.name, node.namespace) == ("demo", "talker", "one_3", "left")
    assert node.parameters == {
        "speed": 3,
        "list": ["a", "b"],
        "text": "3",
        "empty": "",
        "law": "{type: pd, kp: 3}",
        "home": "nowhere",
        "side_by_side": "3/nowhere",
        "nested": [3, 1.5],
    }
    assert node.parameter_files == (launch_file.parent / "talker.yaml",)
    assert node.remappings == (("chatter", "/words"),)
    assert node.arguments == ("--quiet",)
    assert node.ends_graph


def test_conditions_choose_nodes(launch_file):
    graph = load_graph(str(launch_file), {"label": "one", "extra": "true"})
    assert [node.executable for node in graph.nodes] == ["talker", "listener"]


def test_a_file_that_includes_another_gives_its_own_defaults(tmp_path, launch_file):
    outer = tmp_path / "outer.launch.yaml"
    outer.write_text("""
launch:
  - arg: {name: label, default: mine}
  - let: {name: extra, value: "true"}
  - include: {file: $(dirname)/demo.launch.yaml}
""")
    graph = load_graph(str(outer), {"speed": "7"})
    assert graph.name == "outer"
    assert [one.name for one in graph.arguments] == ["label", "speed"]
    talker, listener = graph.nodes
    assert (talker.name, talker.parameters["speed"], listener.executable) == ("mine_7", 7, "listener")


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({}, "argument label must be given"),
        ({"label": "a", "sped": "3"}, "did you mean 'speed'"),
        ({"label": "a", "extra": "maybe"}, "neither true nor false"),
    ],
)
def test_wrong_arguments_are_one_line(launch_file, values, said):
    with pytest.raises(InputError, match=re.escape(said)) as caught:
        load_graph(str(launch_file), values)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[", "line 1: not valid YAML"),
        ("nodes: []", "no YAML launch file"),
        ("launch: [{group: {}}]", "entry 'group'"),
        ("launch: [{node: {pkg: a}}]", "exec is missing"),
        ("launch: [{node: {pkg: a, exec: b, nam: c}}]", "did you mean 'name'"),
        ("launch: [{node: {pkg: a, exec: b, 3: c, nam: d}}]", "key '3'"),
        ("launch: [{node: {pkg: a, exec: $(var b)}}]", "$(var b) has no value"),
        ("launch: [{node: {pkg: a, exec: $(env IDLOOP_NOT_SET)}}]", "$(env IDLOOP_NOT_SET) is not set"),
        ("launch: [{node: {pkg: a, exec: $(env)}}]", "$(env) needs a name"),
        ("launch: [{node: {pkg: a, exec: $(command ls)}}]", "not supported"),
        ("launch: [{node: {pkg: a, exec: $(find-pkg-share nowhere_at_all)}}]", "no ROS package nowhere_at_all"),
        ("launch: [{node: {pkg: a, exec: b, on_exit: respawn}}]", "only shutdown is"),
        ("launch: [{node: {pkg: a, exec: b, param: [{value: 1}]}}]", "key name is missing"),
        ("launch: [{node: {pkg: a, exec: b, param: [[]]}}]", "key name is missing"),
        ("launch: [{node: {pkg: a, exec: b, param: null}}]", "is no list"),
        ("launch: [{node: {pkg: a, exec: b, remap: {from: c}}}]", "is no list"),
        ("launch: [{node: {pkg: a, exec: b, param: [{name: c, value: '{d: 1}'}]}}]", "add type: str"),
        ("launch: [{node: {pkg: a, exec: b, param: [{name: c, value: 1, type: in}]}}]", "only str is"),
        ("launch: [{arg: 3}]", "no mapping"),
        ("launch: [{include: {file: nowhere.yaml}}]", "no launch file nowhere.yaml"),
        ("launch: [{include: {file: a.yaml, arg: []}}]", "only file is supported"),
        ("launch: [{include: {file: $(dirname)/bad.launch.yaml}}]", "recursive include"),
        ("launch: [3]", "no entry"),
    ],
)
def test_files_that_are_not_understood_are_one_line(tmp_path, text, said):
    path = tmp_path / "bad.launch.yaml"
    path.write_text(text)
    with pytest.raises(InputError, match=re.escape(said)) as caught:
        load_graph(str(path))
    assert "\n" not in str(caught.value)


def test_a_value_that_names_itself_is_one_line(launch_file):
    with pytest.raises(InputError, match="recursive substitution"):
        load_graph(str(launch_file), {"label": "$(var label)"})


def test_an_unknown_graph_lists_those_there_are():
    names = "arm, dc_motor, hidden, mujoco, replay, robot, torsion, track"
    with pytest.raises(InputError, match=f"available: {names}") as caught:
        load_graph("torsoin")
    assert "did you mean 'torsion'" in str(caught.value)


@pytest.mark.parametrize("name", ["x" * 300, "idlo\ud800op", "../etc", ""])
def test_a_package_that_cannot_be_one_is_one_line(name):
    with pytest.raises(InputError, match="no ROS package"):
        package_share(name)


def test_a_name_that_no_file_can_have_is_one_line():
    with pytest.raises(InputError, match="no launch file"):
        load_graph(f"{'x' * 300}.yaml")


def test_a_missing_file_is_one_line():
    with pytest.raises(InputError, match=re.escape("no launch file nowhere.yaml")):
        load_graph("nowhere.yaml")


@pytest.mark.parametrize("name", ["dc_motor", "torsion"])
def test_our_graphs_have_five_nodes_and_end_with_the_plant(name):
    graph = load_graph(name)
    assert [node.executable for node in graph.nodes if node.ends_graph] == ["plant"]
    assert len(graph.nodes) == 5
    assert all(file.is_file() for node in graph.nodes for file in node.parameter_files)
    assert name in graph_names()


def test_every_graph_says_in_one_sentence_what_it_runs():
    for name in graph_names():
        said = graph_summary(name)
        assert 20 < len(said) < 140
        assert said[0].isupper()
        assert "ros2 launch" not in said


def test_parameter_files_keep_the_types_of_values():
    from ruamel.yaml import YAML

    values = {"a": 1, "b": 2.0, "c": "y", "d": "1.0", "e": ["on", "x"], "f": [], "g": True, "h": ""}
    read = YAML(typ="safe", pure=True).load(parameter_document(values))["/**"]["ros__parameters"]
    assert read == values | {"f": [""]}
    assert all(f'"{text}"' in parameter_document(values) for text in ("y", "1.0", "on", "x"))
