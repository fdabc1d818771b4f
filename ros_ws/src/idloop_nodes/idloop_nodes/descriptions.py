"""What is known of each kind of node without starting it, from the file of its name in descriptions/.

Nothing in here imports ROS: the start barrier, the documentation and the command line read it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import yaml

from idloop_nodes.parameters import NodeParameter, Table
from idloop_nodes.topics import RECORDED, RESULTS

FOLDER = Path(__file__).with_name("descriptions")
# The files of nodes/ are the one list of executables; setup.py reads the same folder.
KINDS = tuple(sorted(one.stem for one in Path(__file__).parent.glob("nodes/[a-z]*.py")))
GROUPS = {"RECORDED": RECORDED, "RESULTS": RESULTS}  # topics that the files name together
Row = dict[str, Any]


@dataclass(frozen=True)
class NodeDescription:
    """One executable: for its start, for the start barrier of the others, and for the documentation."""

    about: str  # what it does, as Markdown
    # Topics beside `progress` and `/diagnostics`, which all nodes have
    publishes: tuple[str, ...] = ()
    subscribes: tuple[str, ...] = ()
    services: Mapping[str, str] = field(default_factory=dict)  # name of each std_srvs/Trigger service, and what it does
    example: str = ""  # arguments after ``--ros-args`` that show its use
    # Behind a bridge it reads the applied command (`bridge/command`) in place of the requested one
    uses_applied_command: bool = False
    fixed: bool = False  # no parameter can change while the node runs
    signals: bool = False  # the parameters of every kind of signal are among its own
    rows: Mapping[str, Row] = field(default_factory=dict)  # its parameters, as its file has them

    def parameters(self) -> Table:
        """Return its parameter table, which may import parts of the library."""
        common = _read("common")["parameters"]
        rows = [
            self._row(name, row if "type" in row else common.get(name, {}) | row) for name, row in self.rows.items()
        ]
        return (*rows, *(_of_signals() if self.signals else ()))

    def _row(self, name: str, row: Row) -> NodeParameter:
        if "signal" in row:
            from idloop.signals import COMMON_PARAMETERS

            (spec,) = (one for one in COMMON_PARAMETERS if one.name == name)
            return NodeParameter.adopt(spec, name, row.get("default", spec.default))
        content = dict(row)
        fixed = content.pop("fixed", False) or self.fixed
        if isinstance(content["default"], list) or content["default"] in GROUPS:
            content["default"] = _topics(content["default"])
        if content.get("choices") == "SIGNALS":
            from idloop.signals import SIGNALS

            content["choices"] = SIGNALS
        content["choices"] = tuple(content.get("choices", ()))
        return NodeParameter(name, read_only=fixed, **content)


def _of_signals() -> Table:
    from idloop.signals import SIGNALS

    return [
        NodeParameter.adopt(spec, f"{kind.name}.{spec.name}", None if spec.required else spec.default)
        for kind in SIGNALS.values()
        for spec in kind.parameters
    ]


def _topics(names: str | list[str]) -> tuple[str, ...]:
    """Return names, groups of topics written out."""
    listed = [names] if isinstance(names, str) else names
    return tuple(topic for name in listed for topic in GROUPS.get(name, (name,)))


@cache
def _read(name: str) -> Row:
    loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    content: Row = yaml.load((FOLDER / f"{name}.yaml").read_text(encoding="utf-8"), loader)  # noqa: S506  (a safe one)
    return content


@cache
def describe(kind: str) -> NodeDescription:
    """Return the description of a kind of node; KeyError where there is none."""
    if kind not in KINDS:
        raise KeyError(kind)
    content = dict(_read(kind))
    publishes, subscribes = (_topics(content.pop(side, [])) for side in ("publishes", "subscribes"))
    first, last = content.pop("shared_first", ()), content.pop("shared_last", ())
    rows: dict[str, Row] = {**{name: {} for name in first}, **content.pop("parameters"), **{name: {} for name in last}}
    return NodeDescription(publishes=publishes, subscribes=subscribes, rows=rows, **content)
