"""``python relay.py LEFT RIGHT``: passes frames between two network devices, later, twice, in another order or not.

One word and its number on a line of standard input set what happens to each frame from then on: ``delay SECONDS``,
``jitter SECONDS`` (each frame later by up to that, so that they overtake each other), ``drop SHARE``, ``twice SHARE``;
``good`` takes everything back. It tells how many frames each word has struck when its input ends.
"""

from __future__ import annotations

import array
import fcntl
import heapq
import json
import random
import select
import socket
import struct
import sys
import time

_ALL = 3  # ETH_P_ALL
_OUTGOING = 4
_SIOCETHTOOL, _SET_CHECKSUMS = 0x8946, 0x17


def opened(device: str) -> socket.socket:
    """A socket on everything that a device receives."""
    one = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(_ALL))
    one.bind((device, 0))
    one.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 8 << 20)
    return one


def with_checksums(device: str) -> None:
    """Let the system write checksums itself: a frame that we pass on has no hardware that would."""
    value = array.array("B", struct.pack("II", _SET_CHECKSUMS, 0))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        fcntl.ioctl(one, _SIOCETHTOOL, struct.pack("16sP", device.encode(), value.buffer_info()[0]))


def main() -> None:
    """Pass frames on until standard input ends."""
    sides = [opened(device) for device in sys.argv[1:3]]
    across = {sides[0]: sides[1], sides[1]: sides[0]}
    chance = random.Random(0)  # noqa: S311 (faults, no secrets)
    setting = dict.fromkeys(("delay", "jitter", "drop", "twice"), 0.0)
    counts = dict.fromkeys(("passed", "drop", "twice", "later"), 0)
    waiting: list[tuple[float, int, socket.socket, bytes]] = []
    number = 0
    while True:
        now = time.monotonic()
        while waiting and waiting[0][0] <= now:
            _, _, out, frame = heapq.heappop(waiting)
            out.send(frame)
        patience = max(0.0, waiting[0][0] - now) if waiting else None
        ready, _, _ = select.select([*sides, sys.stdin], [], [], patience)
        for one in ready:
            if one is sys.stdin:
                word, *value = sys.stdin.readline().split() or ["end"]
                if word == "end":
                    print(json.dumps(counts), flush=True)
                    return
                if word == "good":
                    setting = dict.fromkeys(setting, 0.0)
                else:
                    setting[word] = float(value[0])
                print("done", flush=True)
                continue
            frame, address = one.recvfrom(65536)
            if address[2] == _OUTGOING:
                continue
            counts["passed"] += 1
            if chance.random() < setting["drop"]:
                counts["drop"] += 1
                continue
            again = chance.random() < setting["twice"]
            counts["twice"] += again
            for _ in range(1 + again):
                late = setting["delay"] + chance.random() * setting["jitter"]
                counts["later"] += late > 0.0
                number += 1
                heapq.heappush(waiting, (time.monotonic() + late, number, across[one], frame))


if __name__ == "__main__":
    main()
