"""One file for each kind of node, named like its module in nodes/; nothing in here imports ROS."""

from __future__ import annotations

import importlib
from functools import cache
from pathlib import Path

from idloop_nodes.descriptions.node_description import NodeDescription

# The files of nodes/ are the one list of executables; setup.py reads the same folder.
KINDS = tuple(sorted(one.stem for one in Path(__file__).parents[1].glob("nodes/[a-z]*.py")))


@cache
def describe(kind: str) -> NodeDescription:
    """Return the description of a kind of node; KeyError where there is none."""
    if kind not in KINDS:
        raise KeyError(kind)
    description: NodeDescription = importlib.import_module(f"idloop_nodes.descriptions.{kind}").DESCRIPTION
    return description
