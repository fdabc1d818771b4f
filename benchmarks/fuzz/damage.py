"""Valid inputs, damaged, or with something in them that asks for more than there is."""

from __future__ import annotations

import random
import re
from collections.abc import Callable

# Longest input [bytes], and longest that is so on purpose.
LONGEST, VERY_LONG = 60_000, 1_500_000
# Share of the inputs with something in them that is no damage but too much.
_TOO_MUCH = 0.15
_TOKEN = re.compile(rb"-?\d+(?:\.\d+)?(?:[eE][+-]?\d+)?|[A-Za-z_]{2,}")
_NUMBERS = (
    b"1e300", b"-1e300", b"1.7976931348623157e308", b"1e999", b"-1e999", b"5e-324", b"1e-300", b"1e16", b"-0.0",
    b"9007199254740993", b"9223372036854775808", b"18446744073709551616", b"-9223372036854775809", b"2147483648",
    b"1e9", b"1e12", b".inf", b"-.inf", b".nan", b"Infinity", b"NaN", b"0", b"0x10", b"0o17", b"0b11", b"1_000",
    b"1:30",
)  # fmt: skip
_DATES = (
    b"2024-01-45", b"2024-13-01", b"0000-00-00", b"99999-01-01", b"2024-02-30T25:61:61", b"2024-01-01 00:00:00 +99:99",
    b"9999-12-31T23:59:59.999999999Z", b"!!timestamp 1", b"!!int one", b"!!float x", b"!!bool x", b"!!binary x",
    b"!!python/object/apply:os.getpid []", b"!!set {a, b}", b"!!omap [a: 1]", b"%YAML 1.1\n---\n", b"<<: *x0",
)  # fmt: skip
_SIGNS = (
    b"\\ud800", b'"\\udfff"', b'"\\ud800\\ud800"', b"\xed\xa0\x80", b"\x1b[31m", b'"\\n"', b"\xe2\x80\xa8", b"\\x00",
    b'"\\x1b]0;x\\x07"', b"\xef\xbb\xbf", b"\xff\xfe", b"::", b"'\\''", b'""', b"'::'", b"'\"'", b"\xc2\x85",
)  # fmt: skip


def damaged(seed: bytes, words: tuple[str, ...], others: list[bytes], chance: random.Random) -> bytes:
    """A valid input with some bytes, words or stretches of it changed, or too much of something in it."""
    data = bytearray(seed)
    most = LONGEST
    if chance.random() < _TOO_MUCH:
        for _ in range(chance.choice((1, 1, 1, 2, 3))):
            _replace(data, chance.choice(TOO_MUCH)(chance), chance)
        most = VERY_LONG
        if chance.random() < 0.7:
            return bytes(data[:most])
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
    return bytes(data[:most])


def _replace(data: bytearray, new: bytes, chance: random.Random) -> None:
    """Put it in place of a word or a number, or somewhere between."""
    tokens = list(_TOKEN.finditer(bytes(data[:LONGEST])))
    if tokens and chance.random() < 0.8:
        token = chance.choice(tokens)
        data[token.start() : token.end()] = new
    else:
        at = chance.randrange(len(data) + 1)
        data[at:at] = new


# Share of what is very large: each takes the time of a hundred others.
_VERY_LARGE = 0.02


def _count(chance: random.Random, small: tuple[int, ...], *large: int) -> int:
    return chance.choice(large if chance.random() < _VERY_LARGE else small)


def _nested(chance: random.Random) -> bytes:
    begin, end = chance.choice(
        ((b"[", b"]"), (b"{a: ", b"}"), (b'{"a":', b"}"), (b"- ", b""), (b"? ", b""), (b"(", b")"))
    )
    count = _count(chance, (63, 65, 100, 990), 20_000)
    return begin * count + (b"1" + end * count if chance.random() < 0.5 else b"")


def _digits(chance: random.Random) -> bytes:
    begin = chance.choice((b"", b"-", b"0x", b"0o", b"0b", b"0.", b"1e", b"1e-", b"%YAML 1."))
    count = _count(chance, (17, 251, 310, 5_000), 100_000)
    if chance.random() < 0.1:
        return b"1" + b":59" * count
    return begin + chance.choice((b"9", b"1", b"7", b"f", b"0", b"1_")) * count


def _aliases(chance: random.Random) -> bytes:
    wide, deep = chance.choice(((10, 9), (3, 30), (1, 300), (1_000, 2)))
    first = chance.choice((b"[1]", b"{a: 1}", b"x" * 1_000))
    if chance.random() < 0.5:
        lines = [b"\nx0: &x0 " + first]
        lines += [b"\nx%d: &x%d [%s]" % (k, k, b", ".join([b"*x%d" % (k - 1)] * wide)) for k in range(1, deep)]
        return b"".join(lines) + b"\n"
    parts = [b"&x0 " + first]
    parts += [b"&x%d [%s]" % (k, b", ".join([b"*x%d" % (k - 1)] * wide)) for k in range(1, deep)]
    return b"[" + b", ".join(parts) + chance.choice((b"]", b", &y [*y]]"))


def _long(chance: random.Random) -> bytes:
    text = chance.choice((b"n", b"1", b"\xc3\xa9", b" n", b"n\n", b"\\u00e9")) * _count(
        chance, (256, 5_000), 140_000, 700_000
    )
    return chance.choice((text, b'"' + text + b'"', b'"' + text))


def _many(chance: random.Random) -> bytes:
    one = chance.choice(
        (b",", b";", b"a,", b"1,", b"[],", b"{},", b'"",', b"a: 1\n", b"- a\n", b"\n", b"#\n", b"a b ", b"null,")
    )
    return one * _count(chance, (300, 2_000), 10_001, 60_000)


# Each makes something of which there is too much.
TOO_MUCH: tuple[Callable[[random.Random], bytes], ...] = (
    _nested, _digits, _aliases, _long, _many,
    lambda chance: chance.choice(_NUMBERS), lambda chance: chance.choice(_NUMBERS),
    lambda chance: chance.choice(_DATES), lambda chance: chance.choice(_SIGNS),
)  # fmt: skip
