"""`idloop launch`: starts a node graph without `ros2 launch`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import click

from idloop.cli import _inputs, _outputs
from idloop.errors import InputError

if TYPE_CHECKING:
    from idloop.graph import Graph

SCHEMA = "idloop/launch/1"


def parse_arguments(words: Sequence[str]) -> dict[str, str]:
    """Split "name:=value" words.

    Raises InputError: when a word has another form.
    """
    values: dict[str, str] = {}
    for word in words:
        name, sign, value = word.partition(":=")
        if not sign or not name:
            raise InputError(f"{word!r} is no argument of a graph: write name:=value, as in duration:=10")
        values[name] = value
    return values


def describe(graph: Graph) -> list[tuple[str, str | None, str]]:
    """Return name, value (None: it must be given) and description of every argument."""
    values = graph.values
    return [
        (one.name, None if one.default is None and not values[one.name] else values[one.name], one.description)
        for one in graph.arguments
    ]


@click.command("launch", short_help="Start a node graph without ros2 launch.")
@click.argument("graph", required=False, metavar="GRAPH")
@click.argument("arguments", nargs=-1, metavar="[NAME:=VALUE]...")
@click.option("--show-args", is_flag=True, help="List the graph's arguments and stop.")
@_inputs.domain_option
@_outputs.json_option
def command(graph: str | None, arguments: tuple[str, ...], show_args: bool, domain: int | None, as_json: bool) -> None:
    """Start GRAPH, one process per node, and end it when the run is over or at Ctrl-C.

    GRAPH is the name of a graph that comes with idloop (none: they are listed) or a ROS 2 YAML launch file.
    """
    from idloop.graph import graph_names, graph_summary, load_graph, run_graph

    if graph is None:
        names = graph_names()
        summaries = [(name, graph_summary(name)) for name in names]
        document = {"schema": SCHEMA, "graphs": names}
        _outputs.print_rows(("graph", "what it runs"), summaries, document, as_json=as_json)
        return
    description = load_graph(graph, parse_arguments(arguments), to_run=not show_args)
    if show_args:
        rows = describe(description)
        declared: list[dict[str, Any]] = [
            {"name": name, "value": value, "description": text} for name, value, text in rows
        ]
        described: dict[str, Any] = {"schema": SCHEMA, "graph": description.name, "arguments": declared}
        shown = [(name, "(must be given)" if value is None else value, text) for name, value, text in rows]
        _outputs.print_rows(("argument", "value", "description"), shown, described, as_json=as_json)
        return
    ended = run_graph(description, say=lambda label, line: _outputs.log(f"[{label}] {line}"), domain_id=domain)
    if as_json:
        end = {"arguments": description.values, "ended": "by itself" if ended else "stopped"}
        _outputs.print_json({"schema": SCHEMA, "graph": description.name, **end})
