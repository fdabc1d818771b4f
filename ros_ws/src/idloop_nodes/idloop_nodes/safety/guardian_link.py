"""The link between a bridge and its guardian: a Unix socket over which each tells the other that it is alive."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import socket
import struct
from dataclasses import asdict, dataclass

from idloop.errors import InputError

AFTER_END_NS = 500_000_000  # time for which it sends in place of a bridge that has ended; then others may send

LONGEST = 65_536  # bytes of a record: a hello or a message to the robot
BACKLOG = 1  # a bridge that comes while another is there waits
HELLO, BEAT = b"H", b"B"  # first byte of what a bridge sends
WATCHES, WAITS, STOPPED = b"W", b"U", b"S"  # first byte of what a guardian sends; the name of its node follows


@dataclass(frozen=True)
class Hello:
    """What a guardian has to know of its bridge."""

    topic: str  # topic on which the robot takes commands, fully qualified
    message: str  # name of the message type it takes, as in the bridge's parameter ``command_type``


def address(domain: int, bridge: str) -> str:
    """Return the abstract socket address of the guardian of a bridge, by ROS domain and its qualified name."""
    # Hashed, since an address holds 107 bytes and a namespace may be longer.
    return "\0idloop-guardian-" + hashlib.sha256(f"{os.getuid()} {domain} {bridge}".encode()).hexdigest()


def _of_this_user(connection: socket.socket) -> bool:
    """Whether the process at the other end runs for the same user, or for root."""
    _, user, _ = struct.unpack("3i", connection.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, 12))
    return user in (os.getuid(), 0)


def _new_socket() -> socket.socket:
    # Sequenced packets: a record is read as it was written, and the end of the other process is an empty one.
    one = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    one.setblocking(False)
    return one


def _receive(connection: socket.socket) -> tuple[list[bytes], bool]:
    """Return the records that have come, and whether the other end is gone."""
    records: list[bytes] = []
    while True:
        try:
            record = connection.recv(LONGEST)
        except BlockingIOError:
            return records, False
        except ConnectionResetError:  # it left something unread; what it had sent comes all the same
            continue
        except OSError:
            return records, True
        if not record:
            return records, True
        records.append(record)


class BridgeEnd:
    """The bridge's end of the link."""

    def __init__(self, where: str, hello: Hello, timeout_ns: int) -> None:
        self.guardian = ""  # fully qualified name of its node, empty before its first record
        self.intervened = False  # whether it has sent in place of the bridge since the time before `listen`
        self._where = where
        self._hello = HELLO + json.dumps(asdict(hello)).encode()
        self._timeout_ns = timeout_ns  # silence after which the guardian counts as hung
        self._connection: socket.socket | None = None
        self._heard: int | None = None  # None before the guardian's first record on this connection
        self._state = WAITS
        self._lost = ""

    def listen(self, now_ns: int) -> str:
        """Take in what the guardian has sent; return why the motor must not be driven. Never waits."""
        self.intervened = self._take(now_ns)
        if self._connection is None or self._heard is None:
            return self._lost or "no guardian watches the bridge (start idloop_nodes guardian)"
        if now_ns - self._heard > self._timeout_ns:
            return "the guardian is silent"
        if self.intervened:
            return "the guardian stopped the motor because the bridge was silent"
        return "" if self._state == WATCHES else "the guardian has not met the robot yet"

    def beat(self, neutral: bytes) -> None:
        """Tell that the bridge is alive, and what the guardian is to send if it falls silent. Never waits."""
        if self._connection is not None:
            with contextlib.suppress(OSError):  # a guardian that hangs does not empty its queue
                self._connection.send(BEAT + neutral)

    def close(self) -> None:
        """End the link."""
        if self._connection is not None:
            self._connection.close()
            self._connection = None

    def _take(self, now_ns: int) -> bool:
        """Take in what has come; return whether the guardian had to stop the motor since the last time."""
        if self._connection is None:
            self._connect()
        if self._connection is None:
            return False
        records, gone = _receive(self._connection)
        if gone:
            self._lost = "the guardian is gone"
            self.close()
            return False
        if records:
            self._heard = now_ns
            self._state = records[-1][:1]
            self.guardian = records[-1][1:].decode(errors="replace")
        return any(record[:1] == STOPPED for record in records)

    def _connect(self) -> None:
        connection = _new_socket()
        try:
            connection.connect(self._where)
            connection.send(self._hello)
        except OSError:
            connection.close()
            return
        if not _of_this_user(connection):
            connection.close()
            return
        self._connection, self._heard = connection, None


class GuardianEnd:
    """The guardian's end of the link; one bridge at a time. InputError: another guardian listens there."""

    def __init__(self, where: str) -> None:
        self.hello: Hello | None = None
        self._listener = _new_socket()
        try:
            self._listener.bind(where)
        except OSError as error:
            self._listener.close()
            raise InputError(f"guardian: another guardian watches this bridge already ({error.strerror})") from error
        self._listener.listen(BACKLOG)
        self._connection: socket.socket | None = None

    @property
    def sockets(self) -> list[socket.socket]:
        """What to wait for."""
        return [self._connection or self._listener]

    @property
    def connected(self) -> bool:
        """Whether a bridge is there."""
        return self._connection is not None

    def receive(self) -> tuple[bytes | None, bool]:
        """Return the newest neutral message, None without a beat, and whether the bridge has gone since last time."""
        if self._connection is None:
            self._accept()
        if self._connection is None:
            return None, False
        neutral: bytes | None = None
        records, gone = _receive(self._connection)
        for record in records:
            if record[:1] == BEAT:
                neutral = record[1:]
            elif record[:1] == HELLO:
                self.hello = Hello(**json.loads(record[1:]))
        if gone:
            self._connection.close()
            self._connection = None
        return neutral, gone

    def send(self, state: bytes, name: str) -> None:
        """Tell the bridge that the guardian is alive, and its state: `WATCHES`, `WAITS` or `STOPPED`."""
        if self._connection is not None:
            with contextlib.suppress(OSError):  # a bridge that hangs does not empty its queue
                self._connection.send(state + name.encode())

    def close(self) -> None:
        """End the link."""
        for one in (self._connection, self._listener):
            if one is not None:
                one.close()
        self._connection = None

    def _accept(self) -> None:
        try:
            connection, _ = self._listener.accept()
        except OSError:
            return
        if not _of_this_user(connection):
            connection.close()
            return
        connection.setblocking(False)
        self._connection = connection


class SilenceWatch:
    """Decides what is sent in place of a bridge that is silent or gone."""

    def __init__(self, silence_ns: int) -> None:
        self.interventions = 0  # how often it sent in place of the bridge
        self.longest_ns = 0  # longest time between two beats
        self._silence_ns = silence_ns  # time without a beat after which the bridge counts as hung
        self._neutral = b""
        self._heard: int | None = None  # None without a bridge
        self._gone_at: int | None = None
        self.intervening = False  # whether it sends in place of the bridge

    def beat(self, now_ns: int, neutral: bytes) -> None:
        """Take in a beat and the message that stops the motor; empty when nothing is to be sent."""
        if self._heard is not None:
            self.longest_ns = max(self.longest_ns, now_ns - self._heard)
        self._heard, self._neutral = now_ns, neutral
        self._gone_at, self.intervening = None, False

    def gone(self, now_ns: int) -> None:
        """Take in that the bridge has ended."""
        self._heard, self._gone_at = None, now_ns

    def tick(self, now_ns: int) -> bytes:
        """Return what has to be sent now, empty for nothing."""
        hung = self._heard is not None and now_ns - self._heard > self._silence_ns
        leaving = self._gone_at is not None and now_ns - self._gone_at <= AFTER_END_NS
        intervening = bool(self._neutral) and (hung or leaving)
        self.interventions += intervening and not self.intervening
        self.intervening = intervening
        return self._neutral if intervening else b""
