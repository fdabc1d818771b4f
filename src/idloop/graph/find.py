"""Locations of the launch files of our bring-up package: an installed ROS workspace or the checkout."""

from __future__ import annotations

import os
import re
from itertools import takewhile
from pathlib import Path

from idloop.errors import InputError
from idloop.spelling import did_you_mean, listed

PACKAGE = "idloop_bringup"
SUFFIX = ".launch.yaml"
_NAME = re.compile(r"[A-Za-z0-9_\-]{1,200}")


def package_share(package: str) -> Path:
    """Return the share folder of a ROS package; InputError: neither in the sourced ROS nor in this checkout."""
    if not _NAME.fullmatch(package):
        raise InputError(f"no ROS package {listed([package])}: not a valid name")
    for prefix in filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)):
        share = Path(prefix) / "share" / package
        if share.is_dir():
            return share
    source = Path(__file__).parents[3] / "ros_ws" / "src" / package
    if source.is_dir():
        return source
    raise InputError(f"no ROS package {package}: source its workspace, or run from the checkout")


def graph_names() -> list[str]:
    """Return the names of the graphs that come with idloop."""
    folder = package_share(PACKAGE) / "launch"
    return sorted(path.name.removesuffix(SUFFIX) for path in folder.glob(f"*{SUFFIX}"))


def graph_summary(name: str) -> str:
    """Return the first sentence of the comment at the head of a graph's launch file."""
    lines = graph_path(name).read_text(encoding="utf-8").splitlines()
    head = " ".join(line.lstrip("# ") for line in takewhile(lambda line: line.startswith("#"), lines))
    return head.partition(". ")[0].removesuffix(".")


def graph_path(name: str) -> Path:
    """Return the launch file of a graph, by its name or path; InputError lists those that there are."""
    path = Path(name)
    if path.suffix in (".yaml", ".yml"):
        if not os.path.isfile(path):  # noqa: PTH113  (pathlib raises where a name is too long)
            raise InputError(f"no launch file {name}: check the path")
        return path
    names = graph_names()
    if name not in names:
        raise InputError(f"no graph {name!r}{did_you_mean(name, names)}; available: {', '.join(names)}")
    return package_share(PACKAGE) / "launch" / f"{name}{SUFFIX}"
