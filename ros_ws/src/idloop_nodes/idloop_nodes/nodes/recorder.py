"""The recorder: every message as it came, in a rosbag2 directory, with every loss counted."""

from __future__ import annotations

import queue
import time

from idloop.errors import IdloopError
from idloop.records.bags.cdr import SECOND
from idloop_nodes.base import StreamNode
from idloop_nodes.codec import Level, Status, peek_stamp
from idloop_nodes.middleware import ros_distribution
from idloop_nodes.progress import DONE, due
from idloop_nodes.streams.bag_writer import BagWriter, CanonicalOrder, choose_folder, rank_topics
from idloop_nodes.streams.held_stream import PolledStream
from idloop_nodes.streams.rates import RateCounter
from idloop_nodes.streams.stream_watch import ArrivalTimes, SequenceCheck
from idloop_nodes.topics import JOINT_STATE, TOPICS

SLACK = 1200  # samples by which streams may run apart before they are written in order
DRAIN_QUIET = 0.1  # seconds without a message after which nothing more is expected at the end
DRAIN_LIMIT = 3.0
# Streams with a message for every sample of a lock-step run, and how long a silent one is waited for [s].
TO_THE_END = ("joint_states", "joint_command", "estimator/prediction", "estimator/residual")
SILENCE_LIMIT = 5.0

Batch = list[tuple[str, int, bytes]]  # topic, log time, payload


class RecorderNode(StreamNode):
    """Polls raw subscriptions and hands batches to a writer thread; a slow disk never holds a subscription up.

    Lock-step: log time is the message's stamp and the order is canonical, so that equal runs give equal bags.
    Real time: log time is the time of arrival. Nothing is written before this node is connected to its own
    graph; when it turns out to be the second of its name, the bag is removed.
    """

    poll_period = 0.02

    def __init__(self) -> None:
        super().__init__("recorder")
        values = self.parameters
        self._lockstep = values["mode"] == "lockstep"
        self.scheduling = "batch" if self._lockstep else "preferred"
        self._period_ns = round(values["sample_time"] * SECOND)
        self._topics = list(dict.fromkeys(values["topics"]))
        self._ranks = rank_topics(self._topics)
        self._by_rank = {rank: topic for topic, rank in self._ranks.items()}
        self._checks = {topic: SequenceCheck(self._period_ns) for topic in self._topics}
        self._streams: dict[str, PolledStream] = {topic: self.poll_topic(topic) for topic in self._topics}
        # full names, as every other recorder would write them
        self._names = {topic: stream.subscription.topic_name for topic, stream in self._streams.items()}
        types = {self._names[topic]: TOPICS.get(topic, (JOINT_STATE, ""))[0] for topic in self._topics}
        folder = choose_folder(values["bag"], values["directory"], values["prefix"])
        self._writer = BagWriter(
            folder,
            types,
            ros_distribution(),
            split_bytes=int(values["split_size"] * 1e6),
            split_ns=int(values["split_duration"] * SECOND),
        )
        self._next_burst = 0.0
        self._order = CanonicalOrder()
        self._watermark = -1
        self._newest = dict.fromkeys(self._topics, -1)
        self._arrivals = ArrivalTimes()
        self._last_arrival = time.monotonic()
        self._batches: queue.SimpleQueue[Batch | None] = queue.SimpleQueue()
        self._early: Batch = []
        self._waiting = 0
        self._overflow = 0
        self._written = RateCounter()
        self._reported: int | None = None
        self._done = False
        self._failure = ""
        self._thread = self.thread(self._write, "writer")
        self._thread.start()
        self.get_logger().info(f"recording {len(self._topics)} topics to {folder}")

    def poll(self) -> None:
        """Empty the subscriptions, write what is due, report how far this node has come."""
        super().poll()
        if "joint_states" in self._streams:
            self.subscribe_silent_again(["joint_states"])
        if self._failure:
            raise IdloopError(self._failure)
        # Long bursts cost less than short ones; an event such as the progress of another node must not cut them short.
        now = time.monotonic()
        if now < self._next_burst:
            return
        self._next_burst = now + 0.9 * self.poll_period
        self._collect()
        self._hand_over()
        self._report()

    def _collect(self) -> int:
        batch: Batch = []
        count = 0
        for topic, stream in self._streams.items():
            check, rank, name = self._checks[topic], self._ranks[topic], self._names[topic]
            for data, information in stream.take():
                count += 1
                stamp = peek_stamp(data)
                check.take(information, stamp)
                self._newest[topic] = max(self._newest[topic], stamp)
                if topic == "joint_states":
                    self._watermark = stamp
                if self._lockstep:
                    self._order.add(stamp, rank, data)
                else:
                    received = information.get("received_timestamp") or time.time_ns()
                    batch.append((name, self._arrivals.of(topic, received), data))
        self._queue(sorted(batch, key=lambda one: one[1]))
        if count:
            self._last_arrival = time.monotonic()
        return count

    def _hand_over(self, everything: bool = False) -> None:
        if not self._lockstep:
            return
        until = None if everything else self._watermark - SLACK * self._period_ns
        due = self._order.take(until)
        self._queue([(self._names[self._by_rank[rank]], stamp, data) for stamp, rank, data in due])

    def _queue(self, batch: Batch) -> None:
        if self._waiting + len(self._early) + len(batch) > self.parameters["queue_limit"]:
            self._overflow += len(batch)
            batch = []
        if self.start.waiting:
            # The messages may be those of another graph, which do not belong into this bag.
            self._early += batch
            return
        batch, self._early = self._early + batch, []
        if not batch:
            return
        self._waiting += len(batch)
        self._batches.put(batch)

    def _report(self) -> None:
        # Back-pressure asks what has been received: the rest is in this process and cannot be overrun.
        if self._watermark >= 0 and due(self._reported, self._watermark, self._period_ns):
            self._reported = self._watermark
            self.tell_progress(self._watermark)
        end = self.progress.end
        if end is not None and not self._done and self._complete(end):
            self._done = True
            self.tell_progress(end, DONE)

    def _complete(self, end: int) -> bool:
        """Whether all streams have reached the end: a sender that has ended sends nothing again that was lost."""
        if self._watermark < end:
            return False
        late = [topic for topic in TO_THE_END if 0 <= self._newest.get(topic, -1) < end]
        return not late or time.monotonic() - self._last_arrival > SILENCE_LIMIT

    def _write(self) -> None:
        """Run in the writer thread: disk pauses of milliseconds stay here."""
        while (batch := self._batches.get()) is not None:
            try:
                for topic, log_time, data in batch:
                    self._writer.write(topic, log_time, data)
            except OSError as error:
                self._failure = self._reason(error)
                return
            self._waiting -= len(batch)
            self._written.count += len(batch)

    def _reason(self, error: OSError) -> str:
        return (
            f"recording to {self._writer.folder} failed: {error.strerror}; what was written before is kept, "
            "and `idloop recover` saves it where it cannot be read"
        )

    def close(self) -> None:
        """Take in what is still on its way, then finish the bag; IdloopError: it could not be written to its end."""
        quiet_since = started = time.monotonic()
        while (now := time.monotonic()) - quiet_since < DRAIN_QUIET and now - started < DRAIN_LIMIT:
            if self._failure:
                break  # it would not be written
            if self._collect():
                quiet_since = now
            time.sleep(0.005)
        self._hand_over(everything=True)
        self._batches.put(None)
        self._thread.join()
        try:
            if self.refused:
                self._writer.discard()
            self._writer.close()
        except OSError as error:
            self._failure = self._failure or self._reason(error)
        if self._failure:
            raise IdloopError(self._failure)
        lost = sum(check.lost for check in self._checks.values())
        if not self._writer.count or self.refused:
            self.get_logger().info(f"nothing was recorded: {self._writer.folder} is not kept")
            return
        self.get_logger().info(
            f"recorded {self._writer.count} messages to {self._writer.folder}, lost {lost}, dropped {self._overflow}"
        )

    def health(self) -> list[Status]:
        """Return rates, losses of every topic and the queue."""
        lost = {topic: check.lost for topic, check in self._checks.items()}
        total = sum(lost.values()) + self._overflow
        values = {
            "bag": str(self._writer.folder),
            "written": str(self._written.count),
            "rate": f"{self._written.rate():.1f}",
            "waiting": str(self._waiting),
            "dropped_by_queue": str(self._overflow),
        }
        values |= {f"received/{topic}": str(check.received) for topic, check in self._checks.items()}
        values |= {f"lost/{topic}": str(count) for topic, count in lost.items()}
        level = Level.ERROR if self._failure else Level.WARN if total else Level.OK
        text = self._failure or f"{self._written.count} messages, {total} lost"
        return [Status("recording", text, level, values)]


make = RecorderNode
