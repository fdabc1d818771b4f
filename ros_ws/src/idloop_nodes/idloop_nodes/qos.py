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
HEALTH_DEPTH = 10
TYPES: dict[str, type] = {
    topics.JOINT_STATE: JointState,
    topics.DIAGNOSTICS: DiagnosticArray,
    topics.HEADER: Header,
    topics.CLOCK: Clock,
}


def stream(depth: int = STREAM_DEPTH, *, reliable: bool = True, latched: bool = False) -> QoSProfile:
    """Return the profile of a stream.

    `depth`: messages of which none may be lost while the reader pauses; 1 where only the newest counts. `reliable`:
    False for a robot that publishes best effort, of which a reliable reader would get nothing. `latched`: a late joiner
    receives the newest.
    """
    return QoSProfile(
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
        history=HistoryPolicy.KEEP_LAST,
        depth=depth,
    )


def topic_type(topic: str) -> type:
    """Return the message class of one of our topics; any other topic is taken for joint states."""
    return TYPES[topics.TOPICS[topic][0]] if topic in topics.TOPICS else JointState


def topic_qos(topic: str, results: int = 1) -> QoSProfile:
    """Return the quality of service of one of our topics; `results` is the depth for a late reader of results."""
    if topic in topics.RESULTS:
        return stream(results, latched=True)
    if topic == "progress":
        # A reader keeps this many of all senders together: a long run must not push the first announcements out.
        return stream(latched=True)
    # Diagnostics tools expect this depth on /diagnostics.
    return stream(HEALTH_DEPTH if topic == "/diagnostics" else STREAM_DEPTH)
