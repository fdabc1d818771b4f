"""Which ROS 2 this is: bags name it, and message types differ a little between distributions."""

from __future__ import annotations

import os
from importlib.metadata import PackageNotFoundError, version

# By the major version of rclpy's wheels, which set no variable; a later one is taken for the newest that is known here.
_OF_WHEELS = {7: "jazzy", 9: "kilted"}
NEWEST = "kilted"


def ros_distribution() -> str:
    """Name of the ROS 2 that is sourced, or else of the one that the installed wheels are of."""
    sourced = os.environ.get("ROS_DISTRO")
    if sourced:
        return sourced
    try:
        major = version("ros-rclpy").partition(".")[0]
    except PackageNotFoundError:
        return NEWEST
    return _OF_WHEELS.get(int(major), NEWEST) if major.isdigit() else NEWEST
