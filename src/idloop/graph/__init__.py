"""Node graphs without `ros2 launch`: YAML launch files, read and run without ROS."""

from __future__ import annotations

from idloop.graph.description import Argument, Graph, NodeEntry, load_graph
from idloop.graph.find import graph_names, graph_path, graph_summary
from idloop.graph.live_results import Findings, LiveResult, read_findings, read_results
from idloop.graph.processes import GraphRun, run_graph
from idloop.graph.replaying import Windows, replay_bag

__all__ = [
    "Argument",
    "Findings",
    "Graph",
    "GraphRun",
    "LiveResult",
    "NodeEntry",
    "Windows",
    "graph_names",
    "graph_path",
    "graph_summary",
    "load_graph",
    "read_findings",
    "read_results",
    "replay_bag",
    "run_graph",
]
