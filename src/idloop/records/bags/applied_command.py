"""What a drive was told, where a recording holds it beside what was asked for.

A bridge holds commands within limits, starts softly and stops the motor; the controller before it knows nothing of
that. The motion answers to what the drive was told.
"""

from __future__ import annotations

from collections.abc import Mapping

from idloop.records.bags.bag import Topic
from idloop.records.bags.stream import JOINT_STATE
from idloop.records.finding import Finding

ASKED, TOLD = "joint_command", "bridge/command"


def told_topic(command: str, topics: Mapping[str, Topic]) -> str:
    """Topic of what the drive was told.

    Parameters
    ----------
    command : str
        Topic of the command, as recorded.
    topics : mapping of str to Topic
        All of the recording.

    Returns
    -------
    str
        That of a bridge beside a `joint_command`, where joint states were recorded on it; else `command` itself.
    """
    folder, _, name = command.rpartition("/")
    beside = f"{folder}/{TOLD}"
    told = topics.get(beside) if name == ASKED else None
    return beside if told is not None and told.count and told.type == JOINT_STATE else command


def told_findings(asked: str, told: str) -> list[Finding]:
    """Say which of the two commands is taken, where there are two."""
    if asked == told:
        return []
    return [Finding("told", f"the command is that of {told}, what the drive was told, not {asked}", where=told)]
