"""Pairs each measurement with the command that holds at its stamp."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING

from idloop.records.bags.cdr import SECOND
from idloop_nodes.codec import CdrError, JointReader
from idloop_nodes.codec.joints import output_columns
from idloop_nodes.streams.held_stream import CommandWait, HeldStream, PolledStream
from idloop_nodes.streams.sample_buffer import SampleBuffer

if TYPE_CHECKING:
    from idloop.physics import Model

BLOCK = 500  # samples processed in one go, so that services stay answered

Sample = tuple[int, tuple[float, ...]]


class SampleInput:
    """Takes messages in and gives blocks of measurements out, in order, as soon as their commands are known."""

    def __init__(
        self, model: Model, period_ns: int, lockstep: bool, buffer: SampleBuffer, restart: Callable[[], None]
    ) -> None:
        self.unreadable = 0
        self.last: int | None = None
        self._period_ns = period_ns
        self._buffer = buffer
        self._restart = restart
        self._command_reader = JointReader([(model.input.joint, model.input.field)])
        self._output_reader = JointReader(output_columns(model))
        self._reference_reader = JointReader([("*", "position"), ("*", "velocity")])
        self._held = HeldStream()
        self._wait = CommandWait(period_ns, lockstep, time.monotonic())
        self._pending: list[Sample] = []

    @property
    def waiting(self) -> int:
        """Measurements whose command is not known yet."""
        return len(self._pending)

    def restart(self) -> None:
        """Forget everything: a new run begins."""
        self._pending.clear()
        self._held.clear()
        self.last = None

    def take(self, references: PolledStream, commands: PolledStream, outputs: PolledStream) -> None:
        """Take in what has arrived."""
        for stream, take in (
            (references, self._take_reference),
            (commands, self._take_command),
            (outputs, self._take_output),
        ):
            for data, _ in stream.take():
                try:
                    take(data)
                except CdrError:
                    self.unreadable += 1

    def _take_reference(self, data: bytes) -> None:
        self._buffer.announce(*self._reference_reader.read(data))

    def _take_command(self, data: bytes) -> None:
        stamp, row = self._command_reader.read(data)
        self._wait.update(time.monotonic())
        self._held.push(stamp, row)
        self._buffer.commands.append(stamp, row)

    def _take_output(self, data: bytes) -> None:
        stamp, row = self._output_reader.read(data)
        newest = self._pending[-1][0] if self._pending else self.last
        if newest is not None and stamp <= newest:
            if newest - stamp <= SECOND:
                return
            self._restart()
        self._pending.append((stamp, row))
        self._buffer.outputs.append(stamp, row)

    def next_block(self, ends: Iterable[int | None], run_end: int | None) -> list[Sample]:
        """Return the next samples whose commands are known; the last one before each of `ends` ends a block [ns]."""
        if not self._pending:
            return []
        block = self._pending[:BLOCK]
        limit = self._wait.known_until(self._held.newest, self._pending[-1][0], run_end, time.monotonic())
        count = sum(stamp <= limit for stamp, _ in block)
        for end in ends:
            if end is not None:
                count = min(count, 1 + sum(stamp < end - self._period_ns * 3 // 2 for stamp, _ in block))
        if not count:
            return []
        block, self._pending = self._pending[:count], self._pending[count:]
        self.last = block[-1][0]
        if self._buffer.first is None:
            self._buffer.first = block[0][0]
        return block

    def commands_of(self, block: Sequence[Sample]) -> list[Sample | None]:
        """Return for each sample of a block the command that holds at its stamp."""
        return [self._held.at(stamp) for stamp, _ in block]
