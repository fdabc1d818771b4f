"""Starting, watching and ending processes, with scripts in place of nodes."""

from __future__ import annotations

import os
import sys
import time

import pytest

from idloop.errors import IdloopError, InputError
from idloop.graph import Graph, GraphRun, NodeEntry, processes, run_graph

CRASHING = """
import os, signal
signal.signal(signal.SIGINT, lambda *_: os.kill(os.getpid(), signal.SIGSEGV))
print("up", flush=True)
while True:
    signal.pause()
"""
SCRIPTS = {
    "brief": "echo done",
    "endless": "echo up; exec sleep 1000",
    "deaf": "trap '' INT TERM; echo up; while :; do sleep 0.1; done",
    "broken": "echo so sorry; exit 3",
    "crashing": f"exec {sys.executable} -c '{CRASHING}'",
    "misled": "echo no such model; exit 2",
    "family": "sleep 1000 & echo child $!; trap '' INT TERM; while :; do sleep 0.1; done",
    "words": 'echo "$@"; echo "$ROS_DOMAIN_ID $ROS_AUTOMATIC_DISCOVERY_RANGE"',
}


@pytest.fixture
def graph(tmp_path, monkeypatch):
    folder = tmp_path / "lib" / "demo"
    folder.mkdir(parents=True)
    for name, text in SCRIPTS.items():
        (folder / name).write_text(f"#!/bin/bash\n{text}\n")
        (folder / name).chmod(0o755)
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path))
    monkeypatch.delenv("ROS_AUTOMATIC_DISCOVERY_RANGE", raising=False)

    def build(*names, ends="brief"):
        nodes = tuple(
            name if isinstance(name, NodeEntry) else NodeEntry("demo", name, ends_graph=name == ends) for name in names
        )
        return Graph(tmp_path, "test", (), {}, nodes)

    return build


@pytest.fixture
def quick(monkeypatch):
    """Less patience with processes that do not listen."""
    monkeypatch.setattr("idloop.graph.processes.GRACE", 0.3)
    monkeypatch.setattr("idloop.graph.processes.FORCE", 0.3)


def gone(process_id):
    try:
        os.kill(process_id, 0)
    except ProcessLookupError:
        return True
    # a process whose parent has not looked yet is dead all the same
    with open(f"/proc/{process_id}/stat") as stream:  # noqa: PTH123
        return stream.read().split()[2] == "Z"


def test_a_graph_ends_with_its_last_node_and_ends_the_others(graph):
    lines = []
    assert run_graph(graph("endless", "brief"), say=lambda label, line: lines.append((label, line)))
    assert ("brief", "done") in lines


def test_a_node_that_fails_ends_the_graph_and_is_quoted(graph):
    with pytest.raises(IdloopError, match="node broken ended with exit code 3: so sorry"):
        run_graph(graph("endless", "broken"), say=lambda label, line: None)


def test_a_node_killed_from_outside_is_not_explained_by_what_it_said_last(graph):
    lines = []
    run = GraphRun(graph("endless", "family"), say=lambda label, line: lines.append(line))

    def killed():
        if len(lines) == 2 and len(run.running) == 2:
            run._children[1].process.kill()
        return False

    try:
        with pytest.raises(IdloopError) as caught:
            run.wait(killed)
    finally:
        run.stop()
    assert str(caught.value) == "node family was killed by signal 9 (SIGKILL)"


def test_a_node_that_ends_too_early_is_told(graph):
    with pytest.raises(IdloopError, match="node brief ended with exit code 0"):
        run_graph(graph("endless", "brief", ends="none"), say=lambda label, line: None)


@pytest.mark.usefixtures("quick")
def test_what_does_not_listen_is_killed_with_its_children(graph):
    lines = []
    run = GraphRun(graph("deaf", "family"), say=lambda label, line: lines.append((label, line)))
    deadline = time.monotonic() + 200
    run.wait(lambda: len(lines) == 2 or time.monotonic() > deadline)
    processes = [child.process.pid for child in run._children]
    grandchild = int(next(line for label, line in lines if label == "family").split()[1])
    run.stop()
    deadline = time.monotonic() + 200
    while not all(map(gone, [*processes, grandchild])):
        assert time.monotonic() < deadline


def test_a_node_that_crashes_while_it_ends_is_told(graph, monkeypatch):
    # Beside other work a crash takes longer than a graph has patience.
    monkeypatch.setattr(processes, "GRACE", 100.0)
    lines = []
    run = GraphRun(graph("endless", "crashing"), say=lambda label, line: lines.append((label, line)))
    deadline = time.monotonic() + 200
    run.wait(lambda: len(lines) == 2 or time.monotonic() > deadline)
    run.stop()
    assert lines[2:] == [("crashing", "died of signal 11")]


def test_nothing_stays_when_a_node_cannot_be_started(graph):
    with pytest.raises(IdloopError, match="node demo/missing is not installed"):
        GraphRun(graph("endless", "missing"))


def test_nodes_get_their_words_and_environment(graph):
    node = NodeEntry("demo", "words", "me", "left", {"a": 1}, (), (("x", "/y"),), ("--fast",), ends_graph=True)
    lines = []
    run_graph(graph(node), say=lambda label, line: lines.append(line), domain_id=42)
    assert lines[0].startswith("--fast --ros-args --params-file ")
    assert lines[0].endswith("-r __node:=me -r __ns:=/left -r x:=/y")
    assert lines[1] == "42 LOCALHOST"


def test_bad_input_of_a_node_is_bad_input_of_the_launcher(graph):
    with pytest.raises(InputError, match="misled: no such model"):
        run_graph(graph("misled", "endless"), say=lambda label, line: None)
