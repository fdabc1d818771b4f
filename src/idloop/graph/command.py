"""The command line and the environment of one node."""

from __future__ import annotations

import json
import os
import shutil
import sys
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from idloop.errors import IdloopError
from idloop.graph.description import NodeEntry

OWN_PACKAGE = "idloop_nodes"


def node_command(node: NodeEntry, parameter_file: Path) -> list[str]:
    """Return the words that start a node; IdloopError: its executable is not installed."""
    command = _executable(node)
    command += [*node.arguments, "--ros-args"]
    for file in node.parameter_files:
        command += ["--params-file", str(file)]
    if node.parameters:
        command += ["--params-file", str(parameter_file)]
    if node.name:
        command += ["-r", f"__node:={node.name}"]
    if node.namespace:
        command += ["-r", f"__ns:=/{node.namespace.strip('/')}"]
    for source, target in node.remappings:
        command += ["-r", f"{source}:={target}"]
    return command


def _executable(node: NodeEntry) -> list[str]:
    if node.package == OWN_PACKAGE and find_spec(OWN_PACKAGE) is not None:
        return [sys.executable, "-m", OWN_PACKAGE, node.executable]
    for prefix in filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)):
        script = Path(prefix) / "lib" / node.package / node.executable
        if os.access(script, os.X_OK):
            return [str(script)]
    found = shutil.which(node.executable, path=str(Path(sys.executable).parent))
    if found and node.package == OWN_PACKAGE:
        return [found]
    raise IdloopError(
        f"node {node.package}/{node.executable} is not installed: pip install -e ros_ws/src/{node.package}, "
        "or source its workspace"
    )


def parameter_document(parameters: Mapping[str, Any]) -> str:
    """Return a parameter file that applies to any node name."""
    lines = ["/**:", "  ros__parameters:"]
    for name, value in parameters.items():
        # ROS reads an empty list as "not set"; our nodes read a list with one empty text as empty.
        # JSON quotes every text: without quotes y, on or 1.0 would be a boolean or a number.
        lines.append(f"    {json.dumps(name)}: {json.dumps([''] if value == [] else value, ensure_ascii=False)}")
    return "\n".join(lines) + "\n"


def node_environment(domain_id: int | None = None) -> dict[str, str]:
    """Return the environment of the nodes: that of this process, by default restricted to this machine."""
    environment = dict(os.environ)
    environment.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    environment["PYTHONUNBUFFERED"] = "1"
    # A node ends by itself when this process is gone.
    environment["IDLOOP_RUNNER"] = str(os.getpid())
    if domain_id is not None:
        environment["ROS_DOMAIN_ID"] = str(domain_id)
    return environment
