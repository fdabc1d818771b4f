"""A process that no other can block: it speaks through sockets, not through shared memory."""

from __future__ import annotations

import os
from pathlib import Path

from idloop.graph.command import OWN_PROFILES, PROFILE_VARIABLES, own_profile, profile_variable

LOOPBACK = tuple(str(Path(__file__).with_name(f"{name}.xml")) for name in ("loopback_udp", "loopback_udp_2"))
RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"


def use_sockets_only() -> None:
    """Keep Fast DDS from using shared memory in this process; call it before ROS starts.

    Whoever is stopped or killed while it holds the lock of a shared segment blocks all who write to it for a second.
    A choice of the user's own (profile file, transports) is left as it is.
    """
    from rclpy.utilities import get_rmw_implementation_identifier

    if "fastrtps" not in get_rmw_implementation_identifier():
        return
    profiles = {os.environ[name] for name in PROFILE_VARIABLES if name in os.environ}
    if profiles - set(OWN_PROFILES):
        return
    if os.environ.get(RANGE) == "LOCALHOST":
        # That range adds shared memory whatever the transports are; the profile says the same without it.
        os.environ[RANGE] = "SYSTEM_DEFAULT"
        os.environ[profile_variable(os.environ)] = own_profile(os.environ, LOOPBACK)
    else:
        os.environ.setdefault("FASTDDS_BUILTIN_TRANSPORTS", "UDPv4")
