"""What all nodes share: parameters, raw streams, health once a second, progress and the start barrier."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.duration import Duration
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rosgraph_msgs.msg import Clock as ClockMessage
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from idloop.errors import InputError
from idloop_nodes import qos, wiring
from idloop_nodes.codec import Status, decode_header, encode_diagnostics, encode_header
from idloop_nodes.duplicate_node_check import LOOK_AROUND, TwinWatch
from idloop_nodes.health_names import check_name
from idloop_nodes.parameters import NodeParameters, Table
from idloop_nodes.progress import DONE, END, READY, Progress
from idloop_nodes.start_barrier import StartBarrier
from idloop_nodes.streams import stream_match

TYPES: dict[str, type] = {
    wiring.JOINT_STATE: JointState,
    wiring.DIAGNOSTICS: DiagnosticArray,
    wiring.HEADER: Header,
    wiring.CLOCK: ClockMessage,
}
WORDS_KEPT = 200
RESULTS_KEPT = 100
DEAF = 3.0  # seconds of a run without a message after which a stream is subscribed anew
LOOK_PERIOD = 0.5  # seconds between two looks at who is missing
SETTLE_LIMIT = 10.0  # seconds for which the end is not announced because a listener has not acknowledged everything
SETTLE_PERIOD = 0.005  # seconds between two looks whether it has


def topic_type(topic: str) -> type:
    """Return the message class of one of our topics; any other topic is taken for joint states."""
    return TYPES[wiring.TOPICS[topic][0]] if topic in wiring.TOPICS else JointState


def topic_qos(topic: str, results: int = 1) -> QoSProfile:
    """Return the quality of service of one of our topics; so many results wait for who takes them late."""
    if topic in wiring.RESULTS:
        return qos.latched(results)
    if topic == "progress":
        # Of all its senders together a reader keeps so many: those of a long run must not crowd out the first words.
        return qos.latched(qos.STREAM_DEPTH)
    if topic == "/diagnostics":
        return qos.health()
    return qos.stream()


class PolledStream:
    """A raw subscription that is read when its node wants to: many messages for one wake-up."""

    def __init__(self, subscription: Any) -> None:
        self.subscription = subscription
        self.heard = False  # whether anything has ever come
        self._type = subscription.msg_type
        self.topic: str = subscription.topic_name

    def take(self, limit: int = 5000) -> Iterator[tuple[bytes, dict[str, Any]]]:
        """Yield (bytes, information) of what has arrived, at most `limit` messages."""
        handle = self.subscription.handle
        with handle:
            for _ in range(limit):
                taken = handle.take_message(self._type, True)
                if taken is None:
                    return
                self.heard = True
                yield taken


class StreamNode(Node):
    """A node whose streams are bytes.

    Parameters
    ----------
    kind : str
        Executable's name; also the default name of the node.
    table : sequence of NodeParameter
        Its parameters.
    """

    poll_period = 0.2  # seconds between calls of `poll` when nothing else wakes the node
    patient = False  # whether others may finish before this node takes its turn
    preferred = False  # whether it must keep up with the clock, beside whatever else runs on the machine

    def __init__(self, kind: str, table: Table, **options: Any) -> None:
        self._polled: list[Any] = []
        super().__init__(kind, **options)
        self.kind = kind
        self.finished = False
        self.broken: BaseException | None = None
        self.refused = False  # whether it came to another graph by mistake, and what it heard is not its own
        self.parameters = NodeParameters(self, table)
        self.others = [peer for peer in self.parameters["peers"] if peer != kind]
        self.progress = Progress()
        self._publishers_by_topic: dict[str, Any] = {}
        self._subscriptions_by_topic: dict[str, Any] = {}
        self._streams_by_topic: dict[str, PolledStream] = {}
        self._running_since: float | None = None
        self._renewed = False
        self._ready = False
        self._twin = TwinWatch(time.monotonic(), LOOK_AROUND if self.others else 0.0)
        self._match = stream_match.StreamMatch()
        self._barrier = StartBarrier(self.others, self.parameters["start_timeout"], time.monotonic())
        self._next_look = 0.0
        self._health_publisher = self.create_publisher(DiagnosticArray, "/diagnostics", qos.health())
        # Whoever comes late hears every word, and of how far a node is the newest only.
        self._word_publisher = self.create_publisher(Header, "progress", qos.latched(WORDS_KEPT))
        self._progress_publisher = self.create_publisher(Header, "progress", qos.latched())
        self.listen("progress", self._hear)
        # Wall time may jump and simulated time may stand still; health goes on in either case.
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._health_timer = self.create_timer(1.0, self._publish_health, clock=steady)

    @property
    def subscriptions(self) -> Iterator[Any]:
        """Subscriptions the executor serves: the polled ones are not its business."""
        return (one for one in super().subscriptions if one not in self._polled)

    def thread(self, run: Callable[[], None], name: str) -> threading.Thread:
        """Return a thread for a loop of this node; when an error ends it, the node ends with that error, too.

        A node whose loop is gone would otherwise stay there and do nothing, without a word.
        """

        def guarded() -> None:
            try:
                run()
            except BaseException as error:  # noqa: BLE001  (handed on to the main thread)
                self.broken = error
                with contextlib.suppress(Exception):  # where that fails too, the first error is the one to be told
                    self.thread_failed()

        return threading.Thread(target=guarded, name=name, daemon=True)

    # streams

    def publisher(self, topic: str) -> Callable[[bytes], None]:
        """Create a raw publisher and return its publish function.

        A sample of a node that has yet to find out whether it belongs to this graph stays unpublished.
        """
        publisher: Any = self.create_publisher(topic_type(topic), topic, topic_qos(topic))
        self._publishers_by_topic[topic] = publisher
        # What rclpy does around it, to tell bytes from messages and to count users, costs as much as a step of a plant.
        publish: Callable[[bytes], None] = publisher.handle.publish_raw
        if not self.others or topic in wiring.RESULTS:
            return publish

        def publish_when_ready(data: bytes) -> None:
            if self._ready:
                publish(data)

        return publish_when_ready

    def listen(self, topic: str, callback: Callable[[bytes], None]) -> None:
        """Call back with the bytes of every message."""
        self._subscriptions_by_topic[topic] = self.create_subscription(
            topic_type(topic), topic, callback, topic_qos(topic), raw=True
        )

    def poll_topic(self, topic: str, message_type: type | None = None) -> PolledStream:
        """Return a subscription that this node empties itself."""
        stream = PolledStream(self._polled_subscription(topic, message_type or topic_type(topic)))
        self._subscriptions_by_topic[topic] = stream.subscription
        self._streams_by_topic[topic] = stream
        return stream

    def _polled_subscription(self, topic: str, message_type: type) -> Any:
        # A recorder that is late must not find a result replaced by the next.
        profile = topic_qos(topic, RESULTS_KEPT)
        subscription = self.create_subscription(message_type, topic, lambda data: None, profile, raw=True)
        self._polled.append(subscription)
        return subscription

    def subscribe_again_if_deaf(self, topics: Sequence[str]) -> None:
        """Replace, once each, subscriptions through which nothing has come although the run goes on.

        A sender that does not know of its reader, while the reader knows of it, is met so anew.

        Parameters
        ----------
        topics : sequence of str
            Polled ones of which every run has messages.
        """
        if not self.progress.reached or self._renewed:
            return
        now = time.monotonic()
        self._running_since = self._running_since or now
        if now - self._running_since < DEAF:
            return
        self._renewed = True
        for topic in topics:
            stream = self._streams_by_topic[topic]
            if stream.heard:
                continue
            self.get_logger().warning(f"nothing has come on {topic} since the run began: subscribes it again")
            self._polled.remove(stream.subscription)
            self.destroy_subscription(stream.subscription)
            stream.subscription = self._polled_subscription(topic, stream.subscription.msg_type)
            self._subscriptions_by_topic[topic] = stream.subscription

    # progress and barrier

    @property
    def waiting(self) -> bool:
        """Whether this node has yet to meet the graph it belongs to; a node without named peers belongs to any."""
        return not self._ready and bool(self.others)

    def _hear(self, data: bytes) -> None:
        stamp, frame = decode_header(data)
        self.progress.hear(stamp, frame)
        name = self.get_name()
        if frame != f"{name}/{READY}":
            return
        if self._twin.second(time.monotonic()):
            self.refused = True
            where = f"{self.get_namespace().rstrip('/')}/{name}"
            self.broken = InputError(
                f"another node {where} runs in ROS domain {self.context.get_domain_id()}: two graphs in one domain and "
                "namespace mix up; give this one a domain of its own (ROS_DOMAIN_ID, idloop launch --domain N) or a "
                "namespace, or end the other"
            )

    def tell_progress(self, stamp: int, word: str = "") -> None:
        """Publish this node's progress.

        Before `END` and `DONE` whoever listens to this node's streams has all that it published: between two topics
        there is no order, and after these words a recorder may close its bag.
        """
        if word in (END, DONE):
            self._settle()
        if word:
            self._word_publisher.publish(encode_header(stamp, f"{self.get_name()}/{word}"))
        else:
            self._progress_publisher.publish(encode_header(stamp, self.get_name()))

    def _settle(self) -> None:
        limit = time.monotonic() + SETTLE_LIMIT
        for publisher in self._publishers_by_topic.values():
            # rclpy waits with the interpreter locked: only asked, the node's other threads go on.
            while not publisher.wait_for_all_acked(Duration()) and time.monotonic() < limit:
                time.sleep(SETTLE_PERIOD)

    def partners(self) -> list[tuple[str, stream_match.Endpoints]]:
        """Look at the other side of every stream: its topic, how many there are, and how many the peers make expect."""
        family = [*self.others, self.kind]
        return [
            (topic, stream_match.subscribers(self, publisher, wiring.expected_subscribers(topic, family), family))
            for topic, publisher in self._publishers_by_topic.items()
        ] + [
            (topic, stream_match.publishers(self, subscription, wiring.expected_publishers(topic, family), family))
            for topic, subscription in self._subscriptions_by_topic.items()
        ]

    def apart(self) -> list[str]:
        """Return the topics of the streams that have not met all of their partners."""
        return [topic for topic, one in self.partners() if not one.complete]

    def matched(self) -> bool:
        """Whether every stream has met all the partners that the peers make expect, whoever else is there."""
        return self._match.complete([one for _, one in self.partners()], time.monotonic())

    def _alone(self) -> bool:
        """Whether this node has found out that no other of its name is there."""
        namesakes = self.get_node_names_and_namespaces().count((self.get_name(), self.get_namespace()))
        return self._twin.alone(namesakes, time.monotonic())

    def announce_when_matched(self) -> bool:
        """Tell the others once that this node is ready; return whether it is.

        Raises
        ------
        IdloopError
            When the peers do not appear in time.
        """
        if self._ready:
            return True
        if self.matched() and self._alone():
            self._ready = True
            self._twin.ready(time.monotonic())
            values = self.parameters.values
            about = [str(values[name]) for name in ("model", "mode") if values.get(name)]
            self.get_logger().info(f"ready: {', '.join(about)}" if about else "ready")
            self.tell_progress(0, READY)
        else:
            self._look_out()
        return self._ready

    def peers_ready(self) -> bool:
        """Whether every other node of the graph has said that it is ready too."""
        if not self.announce_when_matched():
            return False
        if len(self.progress.ready - {self.get_name()}) >= len(self.others):
            return True
        self._look_out()
        return False

    def _look_out(self) -> None:
        """Say for whom this node waits; raise IdloopError when the peers have had their time."""
        now = time.monotonic()
        if not self.others or now < self._next_look:
            return
        self._next_look = now + LOOK_PERIOD
        where = self.get_namespace()
        there = {name for name, namespace in self.get_node_names_and_namespaces() if namespace == where}
        notice = self._barrier.notice(self.progress.ready, there, self.apart(), now)
        if notice:
            self.get_logger().warning(notice)

    # what a node fills in

    def poll(self) -> None:
        """Do what is due; called after every event and at least every `poll_period`."""
        self.announce_when_matched()

    def health(self) -> list[Status]:
        """Return this node's checks, without the node's name."""
        return []

    def thread_failed(self) -> None:
        """Do at once, in the thread that has failed, what cannot wait for the end of the node."""

    def close(self) -> None:
        """Leave the outside world in order; the last thing called while publishing still works."""

    def _publish_health(self) -> None:
        where, name = self.get_namespace(), self.get_name()
        statuses = [
            Status(check_name(where, name, one.name), one.message, one.level, one.values, one.hardware_id)
            for one in self.health()
        ]
        if statuses:
            self._health_publisher.publish(encode_diagnostics(time.time_ns(), statuses))


class ManagedNode(StreamNode, LifecycleNode):
    """A stream node with a lifecycle: only the active state may move a motor."""

    def __init__(self, kind: str, table: Table) -> None:
        self.active = False
        self._configured = False
        super().__init__(kind, table)

    def destroy_node(self) -> None:
        """Destroy the services of the lifecycle as well: left to the collector, they keep their participant alive."""
        super().destroy_node()
        self._state_machine.destroy_when_not_in_use()

    def start_by_itself(self) -> None:
        """Configure and activate when the parameter autostart says so."""
        if self.parameters["autostart"]:
            self.bring_up()

    def bring_up(self) -> None:
        """Go to the active state from wherever the node is."""
        if not self._configured:
            self.trigger_configure()
        if not self.active:
            self.trigger_activate()

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Remember that only activation is left."""
        self._configured = True
        return super().on_configure(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Back to unconfigured."""
        self._configured = False
        return super().on_cleanup(state)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Become active."""
        self.active = True
        self.activated()
        return super().on_activate(state)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Become inactive: from now on only neutral values leave this node."""
        self._leave_active()
        return super().on_deactivate(state)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """End as deactivation does: this transition may come straight from the active state."""
        if self.active:
            self._leave_active()
        return super().on_shutdown(state)

    def _leave_active(self) -> None:
        self.active = False
        self.deactivated()

    def activated(self) -> None:
        """Do what activation needs."""

    def deactivated(self) -> None:
        """Do what deactivation needs."""
