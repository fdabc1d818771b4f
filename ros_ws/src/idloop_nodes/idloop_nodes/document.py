"""``python -m idloop_nodes.document [FILE]``: the reference of all nodes, from the tables that the nodes run on."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from pathlib import Path

from idloop_nodes.descriptions import KINDS, describe
from idloop_nodes.parameters import NodeParameter
from idloop_nodes.topics import TOPICS


def document() -> str:
    """Return the reference as Markdown."""
    lines = [
        "# Nodes",
        "",
        "Written by `python -m idloop_nodes.document docs/nodes.md`; do not edit.",
        "Each node is its own process: `ros2 run idloop_nodes NODE`, or `python -m idloop_nodes NODE`.",
        "Every node publishes `/diagnostics` once a second and `progress`.",
        "",
        "## Topics",
        "",
        *_table(("topic", "type", "content"), ((f"`{name}`", kind, text) for name, (kind, text) in TOPICS.items())),
    ]
    for kind in KINDS:
        lines += _section(kind)
    return "\n".join(lines) + "\n"


def _section(kind: str) -> list[str]:
    node = describe(kind)
    lines = ["", f"## {kind}", "", node.about, ""]
    publishes, subscribes = (", ".join(f"`{one}`" for one in side) for side in (node.publishes, node.subscribes))
    lines.append(f"Publishes: {publishes or 'only the common topics'}.  ")
    instead = " (behind a bridge `bridge/command` instead of `joint_command`)" if node.uses_applied_command else ""
    lines.append(f"Subscribes: {subscribes or 'none'}{instead}.")
    if node.services:
        services = ((f"`{name}`", text) for name, text in node.services.items())
        lines += ["", *_table(("service (std_srvs/Trigger)", "does"), services)]
    header = ("parameter", "type", "default", "range", "unit", "meaning")
    lines += ["", *_table(header, map(_row, node.parameters()))]
    lines += ["", f"    ros2 run idloop_nodes {kind} --ros-args {node.example}"]
    return lines


def _row(spec: NodeParameter) -> tuple[str, ...]:
    default = "not set" if spec.default is None else repr(spec.default) if spec.default != () else "none"
    if isinstance(spec.default, tuple) and spec.default:
        default = ", ".join(map(str, spec.default))
    text = spec.description + (" Fixed at the start." if spec.read_only else "")
    return f"`{spec.name}`", spec.ros_type, default, spec.range_text.replace("|", "/"), spec.unit, text


def _table(header: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> list[str]:
    return [
        "| " + " | ".join(header) + " |",
        "|" + "---|" * len(header),
        *("| " + " | ".join(one.replace("|", "\\|") for one in row) + " |" for row in rows),
    ]


if __name__ == "__main__":
    if len(sys.argv) > 1:
        Path(sys.argv[1]).write_text(document(), encoding="utf-8")
    else:
        sys.stdout.write(document())
