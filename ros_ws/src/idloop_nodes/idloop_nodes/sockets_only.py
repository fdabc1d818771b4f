"""Processes that no other can block: they communicate through sockets, not through shared memory."""

from __future__ import annotations

import os
from pathlib import Path

from idloop_nodes.distribution import ros_distribution

# How Fast DDS is given a profile: from Kilted on, and before. A later one reads the old variable too, with a warning.
PROFILE_VARIABLES = ("FASTDDS_DEFAULT_PROFILES_FILE", "FASTRTPS_DEFAULT_PROFILES_FILE")
TRANSPORTS = "FASTDDS_BUILTIN_TRANSPORTS"
RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"


def use_sockets_only() -> None:
    """Keep Fast DDS from using shared memory in this process; call it before ROS starts.

    A process that is stopped or killed while it holds the lock of a shared segment blocks all writers for a second; one
    whose thread does not answer for a second is taken for dead, and its segment removed; and a killed one leaves its
    segments behind. A choice of the user's own (profile file, transports) is left as it is.
    """
    from rclpy.utilities import get_rmw_implementation_identifier

    if "fastrtps" not in get_rmw_implementation_identifier():
        return
    if any(os.environ.get(name) for name in (*PROFILE_VARIABLES, TRANSPORTS)):
        return
    here = os.environ.get(RANGE) == "LOCALHOST"
    if here:
        # That range adds shared memory whatever the transports are; the profile sets the same range without it.
        os.environ[RANGE] = "SYSTEM_DEFAULT"
    before_kilted = ros_distribution() in ("humble", "jazzy")
    file = f"{'loopback' if here else 'network'}_udp{'_2' if before_kilted else ''}.xml"
    # A variable that is there and empty is a file without a name to Fast DDS 2.
    for name in PROFILE_VARIABLES:
        os.environ.pop(name, None)
    os.environ[PROFILE_VARIABLES[before_kilted]] = str(Path(__file__).with_name(file))
