"""The middleware: which ROS 2 this is, sockets instead of shared memory, a process that the others have forgotten."""

from __future__ import annotations

import os
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

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


# Seconds of silence after which the middleware forgets a participant: leaseDuration in the profiles beside this file,
# and the default of Cyclone DDS. A node that was killed keeps its place as a publisher for so long.
LEASE = 10.0
# The newest announcement may have been under way for a while when the process was stopped.
MARGIN = 1.0
# A process that computes for a long time still announces itself: its middleware has threads of its own.
IDLE_SHARE = 0.2


class StandstillWatch:
    """Tells a stopped process (SIGSTOP, a frozen container) from a busy one.

    The middleware of a stopped process does not notice that the others have removed it, and what it had announced is
    not always announced again: observed as a controller that computes and whose commands the bridge never receives.
    Only a new participant is discovered for certain.

    `now`, `worked`: as of `forgotten`, before the participant is made.
    """

    def __init__(self, now: float, worked: float) -> None:
        self._now, self._worked = now, worked

    def forgotten(self, now: float, worked: float) -> bool:
        """Return whether the process has stood still since the last call for longer than the others wait.

        `now`: steady time [s]; `worked`: processor time of the process [s].
        """
        gap, work = now - self._now, worked - self._worked
        self._now, self._worked = now, worked
        return gap > LEASE - MARGIN and work < IDLE_SHARE * gap
