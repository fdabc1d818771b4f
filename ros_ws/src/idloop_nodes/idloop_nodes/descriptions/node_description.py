"""What is known of a kind of node without starting it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from idloop_nodes.parameters import Table


@dataclass(frozen=True)
class NodeDescription:
    """One executable: for its start, for the start barrier of the others, and for the documentation."""

    about: str  # what it does, as Markdown
    # Returns its parameter table; called when the table is needed, because some import parts of the library
    parameters: Callable[[], Table]
    # Topics beside `progress` and `/diagnostics`, which all nodes have
    publishes: tuple[str, ...] = ()
    subscribes: tuple[str, ...] = ()
    services: Mapping[str, str] = field(default_factory=dict)  # name of each std_srvs/Trigger service, and what it does
    example: str = ""  # arguments after ``--ros-args`` that show its use
    # Behind a bridge it reads the applied command (`bridge/command`) in place of the requested one
    uses_applied_command: bool = False
