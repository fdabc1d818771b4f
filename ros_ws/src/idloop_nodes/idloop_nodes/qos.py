"""Quality of service of every kind of topic, in one place.

A reliable queue shorter than the longest pause of its reader loses samples without a word: depth 10
lost 4 % at 1 kHz when the reader paused 50 ms. Streams are therefore as deep as several seconds.
"""

from __future__ import annotations

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

STREAM_DEPTH = 5000


def stream(depth: int = STREAM_DEPTH) -> QoSProfile:
    """Samples of which none may be lost: measurements, references, commands as a recorder sees them."""
    return QoSProfile(
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.VOLATILE,
        history=HistoryPolicy.KEEP_LAST,
        depth=depth,
    )


def newest() -> QoSProfile:
    """Commands on a machine: only the newest counts."""
    return stream(depth=1)


def robot(*, reliable: bool) -> QoSProfile:
    """Measurements of a robot, which may be published best effort: then a reliable reader would get none."""
    profile = stream()
    profile.reliability = ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT
    return profile


def latched(depth: int = 1) -> QoSProfile:
    """Results: a late joiner receives the newest."""
    return QoSProfile(
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL,
        history=HistoryPolicy.KEEP_LAST,
        depth=depth,
    )


def health() -> QoSProfile:
    """The profile that diagnostics tools expect on /diagnostics."""
    return stream(depth=10)
