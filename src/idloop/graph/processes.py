"""Starts the nodes of a graph, passes on their output, and ends all of them."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from idloop.ending_signals import event_on_ending_signal
from idloop.errors import IdloopError, InputError
from idloop.graph.command import node_command, node_environment, parameter_document
from idloop.graph.description import Graph, NodeEntry

GRACE = 15.0  # seconds for a node to end after SIGINT; a recorder writes its data
FORCE = 3.0  # seconds after SIGTERM before SIGKILL
SENT = signal.SIGINT, signal.SIGTERM, signal.SIGKILL  # to a node, one after the other
POLL = 0.05
BAD_INPUT = 2  # exit code of a node whose parameters or files are wrong

Say = Callable[[str, str], None]


@dataclass
class _Child:
    node: NodeEntry
    label: str
    process: subprocess.Popen[str]
    reader: threading.Thread
    last_line: str = ""


class GraphRun:
    """A running graph.

    `say`: ``say(label, line)`` receives every line of a node; default: stderr. `domain_id`: ROS domain of this graph
    alone. Raises IdloopError: a node cannot be started; the others are stopped.
    """

    def __init__(self, graph: Graph, say: Say | None = None, domain_id: int | None = None) -> None:
        self.graph = graph
        self._say = say or _to_stderr
        self._folder = tempfile.TemporaryDirectory(prefix="idloop_graph_")
        self._children: list[_Child] = []
        environment = node_environment(domain_id)
        try:
            for number, node in enumerate(graph.nodes):
                self._children.append(self._start(number, node, environment))
        except BaseException:
            self.stop()
            raise

    def _start(self, number: int, node: NodeEntry, environment: dict[str, str]) -> _Child:
        file = Path(self._folder.name) / f"{number}_{node.executable}.yaml"
        file.write_text(parameter_document(node.parameters), encoding="utf-8")
        label = node.name or node.executable
        try:
            process = subprocess.Popen(  # noqa: S603
                node_command(node, file),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                env=environment,
                text=True,
                errors="replace",
                # A session of its own: Ctrl-C reaches the runner alone, which then ends the nodes in order.
                start_new_session=True,
            )
        except OSError as error:
            raise IdloopError(f"node {label} cannot be started: {error.strerror}") from error
        child = _Child(node, label, process, threading.Thread())
        child.reader = threading.Thread(target=self._listen, args=(child,), name=label, daemon=True)
        child.reader.start()
        return child

    def _listen(self, child: _Child) -> None:
        for line in child.process.stdout or ():
            text = line.rstrip()
            if text:
                child.last_line = text
                self._say(child.label, text)

    @property
    def running(self) -> list[str]:
        """Labels of the running nodes."""
        return [child.label for child in self._children if child.process.poll() is None]

    def wait(self, stopped: Callable[[], bool] = lambda: False) -> None:
        """Wait for the node that ends the graph, or for `stopped`; IdloopError: another ended, with its last line."""
        while not stopped():
            for child in self._children:
                code = child.process.poll()
                if code is None:
                    continue
                child.reader.join(timeout=1.0)
                if code == 0 and child.node.ends_graph:
                    return
                if code == BAD_INPUT:
                    raise InputError(f"node {child.label}: {child.last_line or 'wrong parameters'}")
                if -code in SENT:  # a signal from outside, unrelated to its last line
                    raise IdloopError(f"node {child.label} was killed by signal {-code} ({signal.Signals(-code).name})")
                what = f"ended with exit code {code}" if code >= 0 else f"was killed by signal {-code}"
                raise IdloopError(f"node {child.label} {what}: {child.last_line or 'no output'}")
            time.sleep(POLL)

    def stop(self) -> None:
        """End every node: SIGINT, then SIGTERM, then SIGKILL."""
        for number, patience in zip(SENT, (GRACE, FORCE, FORCE), strict=True):
            alive = [child for child in self._children if child.process.poll() is None]
            for child in alive:
                with contextlib.suppress(ProcessLookupError):
                    child.process.send_signal(number)
            self._wait_for(alive, patience)
        for child in self._children:
            code = child.process.returncode
            if code is not None and code < 0 and -code not in SENT:
                self._say(child.label, f"died of signal {-code}")
            if code:
                # It did not end by itself: its process group may still contain children.
                with contextlib.suppress(ProcessLookupError, PermissionError):
                    os.killpg(child.process.pid, signal.SIGKILL)
            child.reader.join(timeout=1.0)
            # While another process holds the pipe open, closing would wait for the reader.
            if child.process.stdout is not None and not child.reader.is_alive():
                child.process.stdout.close()
        self._folder.cleanup()

    @staticmethod
    def _wait_for(children: list[_Child], patience: float) -> None:
        end = time.monotonic() + patience
        for child in children:
            with contextlib.suppress(subprocess.TimeoutExpired):
                child.process.wait(timeout=max(0.0, end - time.monotonic()))


def run_graph(graph: Graph, say: Say | None = None, domain_id: int | None = None) -> bool:
    """Run a graph to its end; `say` and `domain_id` as of `GraphRun`.

    Returns: whether it ended by itself; a signal stops it as well (Ctrl-C, a closed terminal, ...). Raises IdloopError:
    a node ended unexpectedly.
    """
    with event_on_ending_signal() as stopped:
        run = GraphRun(graph, say, domain_id)
        try:
            run.wait(stopped.is_set)
        finally:
            run.stop()
        return not stopped.is_set()


def _to_stderr(label: str, line: str) -> None:
    with contextlib.suppress(OSError):  # the terminal may be gone
        sys.stderr.write(f"[{label}] {line}\n")
