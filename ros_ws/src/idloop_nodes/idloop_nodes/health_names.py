"""Names of checks on ``/diagnostics``, the one topic that the graphs of all axes share."""

from __future__ import annotations


def check_name(namespace: str, node: str, check: str) -> str:
    """Return the name under which a node publishes a check: ``left/controller: safety``."""
    return f"{_absolute(namespace, node)[1:]}: {check}"


def seen_from(namespace: str, name: str) -> tuple[str, str]:
    """Return node and check of a published name; nodes of this namespace without it, others from the root.

    `namespace`: of the node that reads, such as ``/left``. `name`: as published; without ``": "`` all of it is the
    node's.
    """
    node, _, check = name.partition(": ")
    return node_seen_from(namespace, f"/{node.lstrip('/')}"), check  # some publish it with the slash


def node_seen_from(namespace: str, node: str) -> str:
    """Return the shortest name of a node: without the namespace where it is the reader's own."""
    own = _absolute(namespace, "")
    absolute = _absolute(namespace, node)
    return absolute.removeprefix(own) if absolute.startswith(own) else absolute


def _absolute(namespace: str, node: str) -> str:
    return node if node.startswith("/") else f"{namespace.rstrip('/')}/{node}"
