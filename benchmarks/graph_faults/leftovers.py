"""What a graph must not leave behind: zombies, processes without a parent, and how much memory each one holds."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path


def _status(pid: int) -> dict[str, str]:
    lines = Path(f"/proc/{pid}/status").read_text(encoding="utf-8", errors="replace").splitlines()
    return {name: value.strip() for name, _, value in (line.partition(":") for line in lines)}


def leftovers(marker: str, ours: Iterable[int]) -> list[str]:
    """Zombies that our processes have not taken up, and processes of ours without a parent of ours.

    Parameters
    ----------
    marker : str
        Text in the environment of every process of the graph.
    ours : iterable of int
        Processes that are meant to be there.
    """
    meant = {*ours, os.getpid()}
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        pid = int(folder.name)
        try:
            status = _status(pid)
            parent = int(status["PPid"])
            if status["State"].startswith("Z"):
                # One whose parent is the campaign has just ended and is taken up by its next look.
                if parent in meant - {os.getpid()}:
                    found.append(f"zombie {status['Name']} of {parent}")
                continue
            words = (folder / "cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace")
            environment = (folder / "environ").read_bytes().decode(errors="replace")
        except (OSError, KeyError):
            continue
        if marker in environment and pid not in meant and parent not in meant and "idloop_nodes" in words:
            found.append(f"left behind: {' '.join(words.split()[-6:])}")
    return found


def memory(pid: int) -> float:
    """Memory that a process and its children hold [MB]."""
    total = 0.0
    for one in [pid, *children(pid)]:
        try:
            total += int(_status(one).get("VmRSS", "0 kB").split()[0]) / 1024
        except OSError:
            continue
    return total


def children(pid: int) -> list[int]:
    """Processes that a process has started."""
    found = []
    for task in Path(f"/proc/{pid}/task").glob("*/children"):
        try:
            found += [int(word) for word in task.read_text().split()]
        except OSError:
            continue
    return found
