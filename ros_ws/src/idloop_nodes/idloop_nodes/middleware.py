"""The middleware: which ROS 2 this is, sockets instead of shared memory, a process that the others have forgotten."""

from __future__ import annotations

import hashlib
import os
import tempfile
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from string import Template

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
TEMPLATE = Path(__file__).with_name("sockets.xml")

# What the discovery range LOCALHOST means, without shared memory, which that range always brings along.
_THIS_MACHINE = {
    "interface": """\
      <interfaceWhiteList><address>127.0.0.1</address></interfaceWhiteList>
      <maxInitialPeersRange>32</maxInitialPeersRange>
""",
    "peers": """\
        <metatrafficUnicastLocatorList><locator/></metatrafficUnicastLocatorList>
        <initialPeersList>
          <locator><udpv4><address>127.0.0.1</address></udpv4></locator>
        </initialPeersList>
""",
}
_FAST_DDS_2 = {"heartbeat": "heartbeatPeriod", "suppression": "nackSupressionDuration", "properties": ""}
# ROS needs no descriptions of types; the thread that answers with them can crash a node that is ending.
_FAST_DDS_3 = {
    "heartbeat": "heartbeat_period",
    "suppression": "nack_supression_duration",
    "properties": """\
      <propertiesPolicy>
        <properties>
          <property><name>fastdds.type_propagation</name><value>disabled</value></property>
        </properties>
      </propertiesPolicy>
""",
}


def profile(*, this_machine: bool, before_kilted: bool) -> str:
    """Return the Fast DDS profile of a process that communicates through sockets alone."""
    words = _FAST_DDS_2 if before_kilted else _FAST_DDS_3
    places = _THIS_MACHINE if this_machine else dict.fromkeys(_THIS_MACHINE, "")
    return Template(TEMPLATE.read_text(encoding="utf-8")).substitute(words | places)


def _profile_file(text: str) -> Path:
    """Return a file of this user with a profile: Fast DDS reads it by name, and other nodes may be reading it now."""
    folder = Path(tempfile.gettempdir()) / f"idloop_profiles_{os.getuid()}"
    folder.mkdir(mode=0o700, exist_ok=True)
    file = folder / f"{hashlib.sha256(text.encode()).hexdigest()[:16]}.xml"
    if not file.is_file() or file.read_text(encoding="utf-8") != text:
        unfinished = file.with_suffix(f".{os.getpid()}")
        unfinished.write_text(text, encoding="utf-8")
        unfinished.replace(file)
    return file


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
    this_machine = os.environ.get(RANGE) == "LOCALHOST"
    if this_machine:
        # That range adds shared memory whatever the transports are; the profile sets the same range without it.
        os.environ[RANGE] = "SYSTEM_DEFAULT"
    before_kilted = ros_distribution() in ("humble", "jazzy")
    # A variable that is there and empty is a file without a name to Fast DDS 2.
    for name in PROFILE_VARIABLES:
        os.environ.pop(name, None)
    file = _profile_file(profile(this_machine=this_machine, before_kilted=before_kilted))
    os.environ[PROFILE_VARIABLES[before_kilted]] = str(file)


# Seconds of silence after which the middleware forgets a participant: leaseDuration in the profile,
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
        """Whether it has stood still for longer than the others wait, by steady and by worked time [s]."""
        gap, work = now - self._now, worked - self._worked
        self._now, self._worked = now, worked
        return gap > LEASE - MARGIN and work < IDLE_SHARE * gap
