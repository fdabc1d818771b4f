"""The example configurations of robots are ones that the nodes take."""

from __future__ import annotations

import pytest
from ruamel.yaml import YAML

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")

from idloop.graph import load_graph
from idloop_nodes.descriptions import KINDS, describe
from idloop_nodes.parameters import accept_all
from idloop_nodes.safety.robot_joints import RobotJoints
from idloop_nodes.safety.safety_gate import gate_settings

EXAMPLES = ["effort", "servo", "driver"]


def sections(example):
    (file,) = {file for node in load_graph("robot", {"robot": example}).nodes for file in node.parameter_files}
    read = YAML(typ="safe", pure=True).load(file.read_text(encoding="utf-8"))
    return {name: section["ros__parameters"] for name, section in read.items()}


@pytest.mark.parametrize("example", EXAMPLES)
def test_every_parameter_is_one_of_the_node(example):
    found = sections(example)
    common = found.pop("/**")
    assert set(common["peers"]) <= set(KINDS)
    for name, values in found.items():
        table = describe(name.removeprefix("/**/")).parameters()
        known = {spec.name for spec in table}
        assert set(values) <= known, name
        accept_all(table, {key: value for key, value in (common | values).items() if key in known})


@pytest.mark.parametrize("example", EXAMPLES)
def test_the_bridge_takes_it(example):
    found = sections(example)
    values = accept_all(describe("bridge").parameters(), found["/**/bridge"])
    assert gate_settings(values).command.command > 0.0
    assert RobotJoints(values).names == ("motor",)


def test_a_graph_of_a_robot_lives_in_its_namespace():
    graph = load_graph("robot", {"namespace": "left", "workbench": "true"})
    assert {node.namespace for node in graph.nodes} == {"left"}
    assert [node.executable for node in graph.nodes if node.ends_graph] == ["bridge"]
