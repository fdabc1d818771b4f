"""What is known of a kind of node without starting it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from idloop_nodes.parameters import Table


@dataclass(frozen=True)
class NodeDescription:
    """One executable: for its start, for the start barrier of the others, and for the documentation.

    Attributes
    ----------
    about : str
        What it does, as Markdown.
    parameters : callable
        Returns its parameter table; called when the table is needed, because some import parts of the library.
    publishes, subscribes : tuple of str
        Topics beside `progress` and `/diagnostics`, which all nodes have.
    services : mapping of str to str
        Name of each std_srvs/Trigger service, and what it does.
    example : str
        Arguments after ``--ros-args`` that show its use.
    uses_applied_command : bool
        Behind a bridge it reads the applied command (`bridge/command`) in place of the requested one.
    """

    about: str
    parameters: Callable[[], Table]
    publishes: tuple[str, ...] = ()
    subscribes: tuple[str, ...] = ()
    services: Mapping[str, str] = field(default_factory=dict)
    example: str = ""
    uses_applied_command: bool = False
