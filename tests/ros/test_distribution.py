"""A ROS 2 that is sourced says its name, that of wheels is known by its version."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError

import pytest

pytest.importorskip("idloop_nodes", reason="idloop_nodes is not installed: pip install -e ros_ws/src/idloop_nodes")

from idloop_nodes import middleware
from idloop_nodes.middleware import NEWEST, ros_distribution


def test_what_is_sourced_counts(monkeypatch):
    monkeypatch.setenv("ROS_DISTRO", "lyrical")
    assert ros_distribution() == "lyrical"


@pytest.mark.parametrize(
    ("found", "name"), [("7.1.6", "jazzy"), ("9.1.2", "kilted"), ("99.0", NEWEST), ("local", NEWEST), (None, NEWEST)]
)
def test_wheels_are_known_by_their_version(monkeypatch, found, name):
    def version(package):
        if found is None:
            raise PackageNotFoundError(package)
        return found

    monkeypatch.delenv("ROS_DISTRO", raising=False)
    monkeypatch.setattr(middleware, "version", version)
    assert ros_distribution() == name
