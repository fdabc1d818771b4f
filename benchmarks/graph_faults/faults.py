"""The faults that the live graph is put through, and what each of them must not do.

A fault takes the graph and a source of chance and returns its `Outcome`. When it comes is chance; how long it lasts,
too.
"""

from __future__ import annotations

import math
import random
import signal
import time
from collections.abc import Callable
from functools import partial

import places
from live import LiveGraph
from outcome import Outcome
from robot_graph import PATIENCE, ZEROS

from idloop.ending_signals import ending_signals
from idloop_nodes.codec import JointSample, encode_joint_state
from idloop_nodes.streams.bag_writer import CHUNK_SIZE

Fault = Callable[[LiveGraph, random.Random], Outcome]

LIMIT = 2.0  # limit.command of the bridge
ENDING = 1.0  # longest time from the last sample that a failed recorder has taken to its end [s]
# Without these, measurements do not come through.
ON_THE_WAY = ("bridge", "robot")
# What may not die, hang or end without a zero.
DRIVERS = ("controller", "excitation", "bridge", "guardian")
# The excitation is published ahead: its last samples are commands still, and good ones.
AHEAD = ("excitation",)
SIGNALS = [number for number in (*ending_signals(), signal.SIGTSTP) if number < signal.SIGRTMIN]


def at_random(graph: LiveGraph, chance: random.Random, most: int = 400) -> None:
    """Let the graph run for a while: so many lines in the robot's log."""
    lines = graph.lines() + chance.randrange(20, most)
    graph.until(lambda: graph.lines() >= lines)


def _zero_after(name: str, number: int, graph: LiveGraph, found: Outcome) -> int:
    """Send a signal that has to stop the motor; return the steady time of it.

    Counted from the signal, not from the last good command: a node that goes on driving shows.
    """
    begin = time.monotonic_ns()
    graph.signal(name, number)
    waited = graph.until_zero_after(begin, 1 if name == "bridge" else ZEROS)
    found.told_zero(waited if name in AHEAD else max(waited, graph.first_zero_after(begin)))
    return begin


def _killed(name: str, graph: LiveGraph, chance: random.Random) -> Outcome:
    at_random(graph, chance)
    found = Outcome()
    begin = time.monotonic_ns()
    if name in DRIVERS:
        _zero_after(name, signal.SIGKILL, graph, found)
    else:
        graph.signal(name, signal.SIGKILL)
    graph.processes[name].wait()
    if name == "recorder":
        kept = graph.kept(begin)
        found.tail = kept.tail
        kept.judge(found)
    _again(name, graph, found, begin)
    return found


def _ended(name: str, number: int, graph: LiveGraph, chance: random.Random) -> Outcome:
    at_random(graph, chance)
    found = Outcome()
    if name == "recorder":
        begin = time.monotonic_ns()
        graph.end_recorder(found)
    else:
        begin = time.monotonic_ns()
        if name in DRIVERS:
            _zero_after(name, number, graph, found)
        else:
            graph.signal(name, number)
        code = graph.processes[name].wait(timeout=PATIENCE)
        if code != 0 and name != "robot":
            found.wrong.append(f"{name} ended with {code}: {graph.said(name).splitlines()[-1:]}")
        if name == "bridge" and graph.newest()[1] != 0.0:
            found.wrong.append(f"the last word of the bridge was {graph.newest()[1]}")
    _again(name, graph, found, begin)
    return found


def _again(name: str, graph: LiveGraph, found: Outcome, begin: int) -> None:
    started = time.monotonic()
    graph.start(name)
    graph.until_alive()
    found.back = time.monotonic() - started
    if name in ON_THE_WAY:
        graph.interrupted(begin)


def _stopped(name: str, graph: LiveGraph, chance: random.Random) -> Outcome:
    at_random(graph, chance)
    found = Outcome()
    begin = time.monotonic_ns()
    try:
        if name in DRIVERS:
            _zero_after(name, signal.SIGSTOP, graph, found)
        else:
            graph.signal(name, signal.SIGSTOP)
            if name == "robot":
                time.sleep(chance.uniform(0.1, 1.5))
            else:
                at_random(graph, chance)
    finally:
        graph.signal(name, signal.SIGCONT)
    started = time.monotonic()
    graph.until_alive()
    found.back = time.monotonic() - started
    if name in ON_THE_WAY:
        graph.interrupted(begin)
    return found


def _recorder_refused(graph: LiveGraph, found: Outcome, code: int, words: tuple[str, ...]) -> None:
    """Hold against the recorder how it ended: by itself, with that exit code and one line that says why."""
    ended = graph.processes["recorder"].wait(timeout=PATIENCE)
    last = graph.last_words("recorder")[-1:]
    if ended != code or not last or not last[0].startswith("recorder: ") or not any(word in last[0] for word in words):
        found.wrong.append(f"the recorder ended with {ended}: {last}")
    if any("Traceback" in line for line in graph.last_words("recorder")):
        found.wrong.append("a traceback")


def _disk_full(graph: LiveGraph, chance: random.Random) -> Outcome:
    found = Outcome()
    graph.end_recorder(found)
    with places.soon_full(graph.folder / f"full_{graph.number}") as (place, fill):
        graph.start("recorder", place / "bag")
        # What is lost can be told only of a recording that has something in it.
        graph.until(lambda: graph.recorded() > 4 * CHUNK_SIZE and graph.measured())
        at_random(graph, chance)
        fill(graph.processes["recorder"].pid, graph.recorded())
        _recorder_refused(graph, found, 1, ("No space left", "File too large"))
        kept = graph.kept(time.monotonic_ns(), place / "bag")
        found.tail = kept.tail
        kept.judge(found, ENDING)
    _again("recorder", graph, found, 0)
    return found


def _read_only(graph: LiveGraph, chance: random.Random) -> Outcome:
    found = Outcome()
    graph.end_recorder(found)
    with places.read_only(graph.folder / f"read_only_{graph.number}") as place:
        if place is None:
            found.wrong.append("nothing is read-only for this user: not counted")
        else:
            graph.start("recorder", place / "bag")
            _recorder_refused(graph, found, 2, ("Read-only", "Permission denied"))
    _again("recorder", graph, found, 0)
    return found


def _closed(graph: LiveGraph, chance: random.Random) -> Outcome:
    """No new file can be made when the recording goes on to its next."""
    found = Outcome()
    graph.end_recorder(found)
    graph.parameters["recorder"]["split_duration"] = 2.0
    graph.start("recorder")
    graph.until(lambda: graph.recorded() > 4 * CHUNK_SIZE and graph.measured())
    try:
        if places.close_for_new_files(graph.bag):
            _recorder_refused(graph, found, 1, ("Operation not permitted", "Permission denied"))
            until = time.monotonic_ns()
        else:
            found.wrong.append("no folder can be closed for this user: not counted")
            until = time.monotonic_ns()
            graph.processes["recorder"].send_signal(signal.SIGINT)
            graph.processes["recorder"].wait(timeout=PATIENCE)
    finally:
        places.open_again(graph.bag)
        del graph.parameters["recorder"]["split_duration"]
    kept = graph.kept(until)
    found.tail = kept.tail
    kept.judge(found, ENDING)
    _again("recorder", graph, found, 0)
    return found


def _ordered(words: tuple[object, ...], back: tuple[object, ...], count: int, graph: LiveGraph,
             chance: random.Random) -> Outcome:  # fmt: skip
    """The robot is silent or its clock is set, and then all is well again."""
    at_random(graph, chance)
    found = Outcome()
    found.told_zero(graph.until_zero_after(graph.order(*words), count))
    at_random(graph, chance, 100)
    graph.order(*back)
    started = time.monotonic()
    graph.until_alive()
    found.back = time.monotonic() - started
    return found


def _faster(graph: LiveGraph, chance: random.Random) -> Outcome:
    """Ten times as many measurements."""
    at_random(graph, chance)
    graph.order("pace", 10)
    at_random(graph, chance, 4000)
    graph.order("pace", 1)
    started = time.monotonic()
    graph.until_alive()
    return Outcome(back=time.monotonic() - started)


def _strange(chance: random.Random) -> bytes:
    """A message of the right type that is not meant for us, or means no good."""
    stamp = time.time_ns() + chance.choice((0, 0, 0, 3600 * 10**9, -3600 * 10**9))
    names = chance.choice((("elsewhere",), ("left", "right"), (), ("motor",), ("elbow", "motor")))
    value = chance.choice((0.0, 9.0, -1e300, math.nan, math.inf))
    long = tuple([value] * len(names))
    # The lists of a JointState need not be as long as its names.
    return encode_joint_state(JointSample(stamp, names, *(chance.choice((long, long[:-1], ())) for _ in range(3))))


def _foreign(topic: str, graph: LiveGraph, chance: random.Random) -> Outcome:
    at_random(graph, chance)
    since = time.monotonic_ns()
    with graph.listener.stranger(topic) as publish:
        for _ in range(chance.randrange(20, 80)):
            publish(_strange(chance))
            lines = graph.lines()
            graph.until(lambda lines=lines: graph.lines() > lines)
    started = time.monotonic()
    graph.until_alive()
    found = Outcome(back=time.monotonic() - started)
    if topic == "/robot/joint_states":
        graph.interrupted(since)  # what follows a jump of the stamps is let through only when it fits again
    worst = max(abs(command) for _, command, _ in graph.told(since))
    if not worst <= LIMIT:
        found.wrong.append(f"the robot was told {worst}")
    return found


NODES = ("excitation", "controller", "bridge", "guardian", "estimator", "recorder", "robot")

FAULTS: dict[str, Fault] = {
    **{f"{name}: kill -9, started again": partial(_killed, name) for name in NODES},
    **{f"{name}: Ctrl-C, started again": partial(_ended, name, signal.SIGINT) for name in NODES if name != "robot"},
    **{
        f"bridge: {signal.Signals(number).name}, started again": partial(_ended, "bridge", number)
        for number in SIGNALS
        if number != signal.SIGINT
    },
    **{f"{name}: SIGSTOP, SIGCONT": partial(_stopped, name) for name in NODES},
    "disk full": _disk_full,
    "bag directory read-only": _read_only,
    "no new file can be made": _closed,
    "robot silent": partial(_ordered, ("quiet",), ("good",), 20),
    "robot's clock an hour ahead": partial(_ordered, ("jump", 3600), ("jump", -3600), 1),
    "robot's clock an hour behind": partial(_ordered, ("jump", -3600), ("jump", 3600), 1),
    "ten times the rate": _faster,
    "foreign messages on joint_command": partial(_foreign, "/joint_command"),
    "foreign messages on joint_states": partial(_foreign, "/joint_states"),
    "foreign messages on the robot's topic": partial(_foreign, "/robot/joint_states"),
}
