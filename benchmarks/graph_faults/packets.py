"""Packets between a robot and its graph that come late, twice, in another order, or not at all.

The robot, or the nodes that drive it, run in a network namespace of their own, and every frame to the rest of the graph
goes through a relay of ours: the queueing discipline `netem` is not in every kernel. Making namespaces takes the rights
of root; nothing outside of them is touched.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import random
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path

from faults import LIMIT, Fault, at_random
from live import LiveGraph
from outcome import Outcome
from relay import with_checksums

IP = shutil.which("ip") or "/sbin/ip"
# What is in a namespace of its own, and the faults are named by it.
FAR = {"robot": ("robot",), "drivers": ("excitation", "controller")}


def _ip(*words: str) -> None:
    subprocess.run([IP, *words], check=True, capture_output=True)


def left_out() -> str:
    """What is not counted here, and why."""
    with contextlib.suppress(OSError, subprocess.CalledProcessError):
        _ip("netns", "add", _name("probe"))
        _ip("netns", "del", _name("probe"))
        return ""
    return "packets are not delayed or dropped: network namespaces take the rights of root and the command ip"


def _name(side: str) -> str:
    return f"idloop_{side}_{os.getpid()}"


@contextlib.contextmanager
def _network() -> Iterator[tuple[str, str, subprocess.Popen[str]]]:
    """Two namespaces with a relay between them."""
    near, middle, far = (_name(side) for side in ("near", "middle", "far"))
    process = None
    try:
        for one in (near, middle, far):
            _ip("netns", "add", one)
            _ip("-n", one, "link", "set", "lo", "up")
        for side, address in ((near, "10.77.0.1/24"), (far, "10.77.0.2/24")):
            end = f"to_{'near' if side == near else 'far'}"
            _ip("-n", side, "link", "add", "robot0", "type", "veth", "peer", "name", end, "netns", middle)
            _ip("-n", side, "address", "add", address, "dev", "robot0")
            _ip("-n", side, "link", "set", "robot0", "multicast", "on", "up")
            _ip("-n", side, "route", "add", "224.0.0.0/4", "dev", "robot0")
            _ip("-n", middle, "link", "set", end, "up")
            with _inside(side):
                with_checksums("robot0")
        process = subprocess.Popen(
            [IP, "netns", "exec", middle, sys.executable, str(Path(__file__).with_name("relay.py")), "to_near",
             "to_far"],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        )  # fmt: skip
        Relay(process).tell("good")
        yield near, far, process
    finally:
        if process is not None:
            process.kill()
            process.wait()
        for one in (near, middle, far):
            subprocess.run([IP, "netns", "del", one], check=False, capture_output=True)


@contextlib.contextmanager
def _inside(namespace: str) -> Iterator[None]:
    """Put the thread that asks, and whatever it starts, into a network namespace."""
    system = ctypes.CDLL(None, use_errno=True)
    with Path("/proc/thread-self/ns/net").open("rb") as home, Path("/run/netns", namespace).open("rb") as there:
        if system.setns(there.fileno(), 0):
            raise OSError(ctypes.get_errno(), "setns")
        try:
            yield
        finally:
            system.setns(home.fileno(), 0)


class Relay:
    """The relay, spoken to."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self._process = process

    def tell(self, *words: object) -> str:
        """Set what happens to frames from now on; return what the relay says to that."""
        stdin, stdout = self._process.stdin, self._process.stdout
        if stdin is None or stdout is None:
            return ""
        stdin.write(" ".join(map(str, words)) + "\n")
        stdin.flush()
        return stdout.readline().strip()


TROUBLE: dict[str, tuple[tuple[object, ...], ...]] = {
    "packets 20 ms late": (("delay", 0.02),),
    "packets up to 30 ms late, in another order": (("jitter", 0.03),),
    "one packet in five dropped": (("drop", 0.2),),
    "every packet twice": (("twice", 1.0),),
    "all of these": (("delay", 0.005), ("jitter", 0.02), ("drop", 0.1), ("twice", 0.3)),
}
CUT = "no packet comes through"

LiveRound = Callable[[Path, Mapping[str, Fault], random.Random, dict[str, list[Outcome]], Mapping[str, Sequence[str]]],
                     None]  # fmt: skip


def round_of(folder: Path, chance: random.Random, found: dict[str, list[Outcome]], live_round: LiveRound) -> None:
    """Every trouble once between robot and graph, and once between the bridge and those that drive it."""
    if left_out():
        return
    for where, names in FAR.items():
        own = folder / where
        own.mkdir()
        with _network() as (near, far, process), _inside(near), _on_the_network():
            relay = Relay(process)
            faults: dict[str, Fault] = {
                f"{where} far away: {name}": partial(_trouble, relay, settings) for name, settings in TROUBLE.items()
            }
            faults[f"{where} far away: {CUT}"] = partial(_cut, relay)
            live_round(own, faults, chance, found, dict.fromkeys(names, (IP, "netns", "exec", far)))
            print(f"frames between, with {where} far away: {relay.tell('end')}")


@contextlib.contextmanager
def _on_the_network() -> Iterator[None]:
    """Sockets, and nodes on other machines: shared memory would go past the relay."""
    variables = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET", "FASTDDS_BUILTIN_TRANSPORTS": "UDPv4"}
    before = {name: os.environ.get(name) for name in variables}
    os.environ |= variables
    try:
        yield
    finally:
        for name, value in before.items():
            os.environ.pop(name)
            if value is not None:
                os.environ[name] = value


def _trouble(relay: Relay, settings: tuple[tuple[object, ...], ...], graph: LiveGraph,
             chance: random.Random) -> Outcome:  # fmt: skip
    at_random(graph, chance)
    since = time.monotonic_ns()
    for words in settings:
        relay.tell(*words)
    at_random(graph, chance, 1500)
    relay.tell("good")
    started = time.monotonic()
    graph.until_alive()
    graph.interrupted(since)
    found = Outcome(back=time.monotonic() - started)
    worst = max(abs(command) for _, command, _ in graph.told(since))
    if not worst <= LIMIT:
        found.wrong.append(f"the robot was told {worst}")
    return found


def _cut(relay: Relay, graph: LiveGraph, chance: random.Random) -> Outcome:
    """Nothing comes through: a bridge on the robot's side says zero; one on the other side cannot reach it."""
    at_random(graph, chance)
    found = Outcome()
    since = time.monotonic_ns()
    relay.tell("drop", 1.0)
    if "robot" in graph.prefixes:
        time.sleep(chance.uniform(0.1, 1.0))
    else:
        found.told_zero(graph.until_zero_after(since))
    relay.tell("good")
    started = time.monotonic()
    graph.until_alive()
    found.back = time.monotonic() - started
    graph.interrupted(since)
    return found
