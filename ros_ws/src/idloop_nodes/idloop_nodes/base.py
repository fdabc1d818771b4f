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
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import Header
from std_srvs.srv import Trigger

from idloop.errors import InputError
from idloop_nodes import qos
from idloop_nodes.codec import Status, decode_header, encode_diagnostics, encode_header
from idloop_nodes.codec.diagnostics import check_name
from idloop_nodes.descriptions import describe
from idloop_nodes.graph_start import GraphStart
from idloop_nodes.parameters import NodeParameters, Table
from idloop_nodes.progress import DONE, END, READY, Progress
from idloop_nodes.qos import topic_qos, topic_type
from idloop_nodes.streams.held_stream import PolledStream
from idloop_nodes.streams.stream_match import QualityWatch
from idloop_nodes.timing import Scheduling
from idloop_nodes.topics import RESULTS

EVENTS_KEPT = 200
RESULTS_KEPT = 100
NO_MESSAGES = 3.0  # seconds of a run without a message after which a stream is subscribed again
SETTLE_LIMIT = 10.0  # seconds for which the end is not announced because a listener has not acknowledged everything
SETTLE_PERIOD = 0.005  # seconds between two checks of the acknowledgements


class StreamNode(Node):
    """A node whose streams are bytes, of a `kind` (its executable), with its parameters in a `table`."""

    poll_period = 0.2  # seconds between calls of `poll` when nothing else wakes the node
    scheduling: Scheduling = "normal"  # batch: may lag behind; preferred: keeps up with the clock beside other work

    def __init__(self, kind: str, table: Table | None = None, **options: Any) -> None:
        self._polled: list[Any] = []
        super().__init__(kind, **options)
        self.kind = kind
        self.finished = False
        self.broken: BaseException | None = None
        self.refused = False  # whether it is the second node of its name, so that what it received is not its own
        self.parameters = NodeParameters(self, describe(kind).parameters() if table is None else table)
        self.others = [peer for peer in self.parameters["peers"] if peer != kind]
        self.progress = Progress()
        self.publishers_by_topic: dict[str, Any] = {}
        self.subscriptions_by_topic: dict[str, Any] = {}
        self._streams_by_topic: dict[str, PolledStream] = {}
        self._running_since: float | None = None
        self._subscribed_again = False
        self.start = GraphStart(self)
        self.quality = QualityWatch(self, self.get_logger().warning)
        self._health_publisher = self.create_publisher(DiagnosticArray, "/diagnostics", topic_qos("/diagnostics"))
        # A late joiner receives every event, and of how far a node has come the newest only.
        self._event_publisher = self.create_publisher(Header, "progress", qos.stream(EVENTS_KEPT, latched=True))
        self._progress_publisher = self.create_publisher(Header, "progress", qos.stream(1, latched=True))
        self.listen("progress", self._on_progress)
        # Wall time may jump and simulated time may stand still; health goes on in either case.
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._health_timer = self.create_timer(1.0, self._publish_health, clock=steady)

    @property
    def subscriptions(self) -> Iterator[Any]:
        """Subscriptions that the executor serves: the polled ones are not among them."""
        return (one for one in super().subscriptions if one not in self._polled)

    def thread(self, run: Callable[[], None], name: str) -> threading.Thread:
        """Return a thread for a loop; its error ends the node, which would otherwise do nothing in the graph."""

        def guarded() -> None:
            try:
                run()
            except BaseException as error:  # noqa: BLE001  (handed on to the main thread)
                self.broken = error
                with contextlib.suppress(Exception):  # where that fails too, the first error is the one to report
                    self.thread_failed()

        return threading.Thread(target=guarded, name=name, daemon=True)

    # streams

    def publisher(self, topic: str) -> Callable[[bytes], None]:
        """Create a raw publisher; return its publish function, silent until the node knows that this is its graph."""
        publisher: Any = self.create_publisher(topic_type(topic), topic, topic_qos(topic))
        self.publishers_by_topic[topic] = publisher
        # What rclpy does around it, to tell bytes from messages and to count users, costs as much as a step of a plant.
        publish: Callable[[bytes], None] = publisher.handle.publish_raw
        if not self.others or topic in RESULTS:
            return publish

        def publish_when_ready(data: bytes) -> None:
            if self.start.ready:
                publish(data)

        return publish_when_ready

    def listen(self, topic: str, callback: Callable[[bytes], None]) -> None:
        """Call back with the bytes of every message."""
        subscription = self.subscribe(topic_type(topic), topic, callback, self._profile(topic))
        self.subscriptions_by_topic[topic] = subscription

    def subscribe(
        self, message_type: type, topic: str, callback: Callable[[bytes], None], profile: QoSProfile, **events: Any
    ) -> Any:
        """Return a subscription to bytes that notices publishers whose quality of service does not satisfy it."""
        callbacks = self.quality.callbacks(topic, **events)
        subscription = self.create_subscription(
            message_type, topic, callback, profile, raw=True, event_callbacks=callbacks
        )
        choice = "reliable" in self.parameters.values and message_type is JointState
        self.quality.watch(topic, subscription, f"start {self.kind} with `reliable: false`" if choice else "")
        return subscription

    def _profile(self, topic: str, results: int = 1) -> QoSProfile:
        """Quality of service of one of our topics; joint states best effort where `reliable` is false."""
        profile = topic_qos(topic, results)
        if topic_type(topic) is JointState and not self.parameters.values.get("reliable", True):
            profile.reliability = ReliabilityPolicy.BEST_EFFORT
        return profile

    def poll_topic(self, topic: str) -> PolledStream:
        """Return a subscription that this node empties itself."""
        stream = PolledStream(self._polled_subscription(topic, topic_type(topic)))
        self.subscriptions_by_topic[topic] = stream.subscription
        self._streams_by_topic[topic] = stream
        return stream

    def _polled_subscription(self, topic: str, message_type: type) -> Any:
        # A recorder that is late must not find a result replaced by the next.
        profile = self._profile(topic, RESULTS_KEPT)
        subscription = self.subscribe(message_type, topic, lambda data: None, profile)
        self._polled.append(subscription)
        return subscription

    def subscribe_silent_again(self, topics: Sequence[str]) -> None:
        """Replace, once each, polled subscriptions that get nothing in a run: their publishers do not know of them."""
        if not self.progress.reached or self._subscribed_again:
            return
        now = time.monotonic()
        self._running_since = self._running_since or now
        if now - self._running_since < NO_MESSAGES:
            return
        self._subscribed_again = True
        for topic in topics:
            stream = self._streams_by_topic[topic]
            if stream.received:
                continue
            self.get_logger().warning(f"no message on {topic} since the run began: subscribes again")
            self._polled.remove(stream.subscription)
            self.destroy_subscription(stream.subscription)
            stream.subscription = self._polled_subscription(topic, stream.subscription.msg_type)
            self.subscriptions_by_topic[topic] = stream.subscription

    def offer(self, name: str, run: Callable[[], str]) -> None:
        """Offer a std_srvs/Trigger; `run` returns its message, or raises InputError with the reason of a refusal."""

        def answer(request: Any, response: Any) -> Any:
            try:
                response.success, response.message = True, run()
            except InputError as error:
                response.success, response.message = False, str(error)
            return response

        self.create_service(Trigger, name, answer)

    # progress

    def _on_progress(self, data: bytes) -> None:
        stamp, frame = decode_header(data)
        self.progress.update(stamp, frame)
        if frame == f"{self.get_name()}/{READY}" and (error := self.start.refuse_duplicate()) is not None:
            self.refused, self.broken = True, error

    def tell_progress(self, stamp: int, event: str = "") -> None:
        """Publish this node's progress.

        Before `END` and `DONE` every listener of this node's streams has all that it published: between two topics
        there is no order, and after these events a recorder may close its bag.
        """
        if event in (END, DONE):
            self._wait_for_acknowledgements()
        if event:
            self._event_publisher.publish(encode_header(stamp, f"{self.get_name()}/{event}"))
        else:
            self._progress_publisher.publish(encode_header(stamp, self.get_name()))

    def _wait_for_acknowledgements(self) -> None:
        limit = time.monotonic() + SETTLE_LIMIT
        for publisher in self.publishers_by_topic.values():
            # rclpy waits with the interpreter locked: only asked, the node's other threads go on.
            while not publisher.wait_for_all_acked(Duration()) and time.monotonic() < limit:
                time.sleep(SETTLE_PERIOD)

    # what a node fills in

    def poll(self) -> None:
        """Do what is due; called after every event and at least every `poll_period`."""
        self.start.announce()

    def health(self) -> list[Status]:
        """Return this node's checks, without the node's name."""
        return []

    def thread_failed(self) -> None:
        """Do at once, in the thread that has failed, what cannot wait for the end of the node."""

    def close(self) -> None:
        """Leave the outside world in order; the last thing called while publishing still works."""

    def _publish_health(self) -> None:
        where, name = self.get_namespace(), self.get_name()
        self.quality.check()
        statuses = [
            Status(check_name(where, name, one.name), one.message, one.level, one.values, one.hardware_id)
            for one in [*self.health(), *self.quality.status()]
        ]
        if statuses:
            self._health_publisher.publish(encode_diagnostics(time.time_ns(), statuses))
