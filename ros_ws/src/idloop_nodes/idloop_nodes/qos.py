"""Message type and quality of service of every topic.

A reliable queue shorter than the longest pause of its reader loses samples without notice: depth 10
lost 4 % at 1 kHz when the reader paused 50 ms. Streams are therefore as deep as several seconds.
"""

from __future__ import annotations

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from idloop_nodes import topics

STREAM_DEPTH = 5000
TYPES: dict[str, type] = {
    topics.JOINT_STATE: JointState,
    topics.DIAGNOSTICS: DiagnosticArray,
    topics.HEADER: Header,
    topics.CLOCK: Clock,
}


def stream(depth: int = STREAM_DEPTH) -> QoSProfile:
    """Samples of which none may be lost: measurements, references, commands for a recorder."""
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
    profile = stream(depth)
    profile.durability = DurabilityPolicy.TRANSIENT_LOCAL
    return profile


def health() -> QoSProfile:
    """The profile that diagnostics tools expect on /diagnostics."""
    return stream(depth=10)


def topic_type(topic: str) -> type:
    """Return the message class of one of our topics; any other topic is taken for joint states."""
    return TYPES[topics.TOPICS[topic][0]] if topic in topics.TOPICS else JointState


def topic_qos(topic: str, results: int = 1) -> QoSProfile:
    """Return the quality of service of one of our topics; `results` is the depth for a late reader of results."""
    if topic in topics.RESULTS:
        return latched(results)
    if topic == "progress":
        # A reader keeps this many of all senders together: a long run must not push the first announcements out.
        return latched(STREAM_DEPTH)
    if topic == "/diagnostics":
        return health()
    return stream()
