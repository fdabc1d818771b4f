"""Names of checks where the graphs of several axes share one topic."""

from __future__ import annotations

import pytest

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")

from hypothesis import given
from hypothesis import strategies as st

from idloop_nodes.codec.diagnostics import check_name, node_seen_from, seen_from

WORDS = st.from_regex("[a-z][a-z_0-9]{0,8}", fullmatch=True)
SPACES = st.lists(WORDS, max_size=3).map(lambda parts: "/" + "/".join(parts))


def test_a_graph_at_the_root_has_plain_names():
    assert check_name("/", "controller", "safety") == "controller: safety"
    assert seen_from("/", "controller: safety") == ("controller", "safety")
    assert seen_from("/", "left/controller: safety") == ("left/controller", "safety")


@given(SPACES, WORDS, st.text(max_size=9))
def test_a_node_knows_the_checks_of_its_own_namespace(space, node, check):
    assert seen_from(space, check_name(space, node, check)) == (node, check)
    assert node_seen_from(space, node) == node


@given(SPACES.filter(lambda one: one != "/"), WORDS, WORDS)
def test_another_axis_is_never_taken_for_this_one(space, other, node):
    beside = f"{space}{other}"  # begins with the same letters
    for elsewhere in ("/", beside):
        assert seen_from(space, check_name(elsewhere, node, "safety"))[0].startswith("/")


def test_a_check_of_somebody_else_keeps_its_name():
    assert seen_from("/", "fan speed") == ("fan speed", "")
    assert seen_from("/left", "drive: temperature") == ("/drive", "temperature")
    assert seen_from("/", "/drive: temperature") == ("drive", "temperature")
    assert seen_from("/left", "/left/drive: temperature") == ("drive", "temperature")
    assert node_seen_from("/left", "/left/bridge") == "bridge"
    assert node_seen_from("/left", "/bridge") == "/bridge"
