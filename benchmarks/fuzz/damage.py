"""Valid inputs, damaged."""

from __future__ import annotations

import random

# Longest input [bytes].
LONGEST = 60_000


def damaged(seed: bytes, words: tuple[str, ...], others: list[bytes], chance: random.Random) -> bytes:
    """A valid input with some bytes, words or stretches of it changed."""
    data = bytearray(seed)
    for _ in range(chance.choice((1, 1, 2, 4, 16))):
        at = chance.randrange(len(data) + 1)
        kind = chance.randrange(7)
        if kind == 0 and at < len(data):
            data[at] ^= 1 << chance.randrange(8)
        elif kind == 1 and at < len(data):
            data[at] = chance.choice(b"\x00\xff\x7f\x80-.,:;{}[]\"'0e9 \n\t")
        elif kind == 2:
            del data[at : at + chance.choice((1, 4, 64, 4096))]
        elif kind == 3:
            there = chance.randrange(len(data) + 1)
            data[at:at] = data[there : there + chance.choice((1, 8, 64, 512))]
        elif kind == 4 and words:
            data[at:at] = chance.choice(words).encode()
        elif kind == 5:
            other = chance.choice(others)
            there = chance.randrange(len(other) + 1)
            data[at : at + 64] = other[there : there + 64]
        else:
            data[at : at + 8] = chance.choice((b"nan", b"1e400", b"-1", b"null", b"[]", b"{}", b"\xff" * 8, b"\0" * 8))
    return bytes(data[:LONGEST])
