"""The strips of one browser: it asks for a stretch of the streams, and is sent only what it does not have yet."""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from idloop.arrays import Array
from idloop.errors import InputError

if TYPE_CHECKING:
    from idloop.reporting.workbench.signals import Signals

ONE_STEP, FREE_RUN = "one_step", "free_run"
# Streams of the model and of its residual, by what the reader wants to see.
SHOWN = {ONE_STEP: ("predicted", "residual"), FREE_RUN: ("free_run", "free_error")}
FEWEST, MOST = 50, 2000  # buckets of time across a strip
LONGEST = 1e6  # seconds that one picture may span
ALIGNMENT = 8  # bytes: a browser reads 64-bit floats at multiples of it only


@dataclass(frozen=True)
class Question:
    """What a browser wants to see and what it has."""

    follow: float | None = None  # length of the newest stretch [s]; None shows `stretch`
    stretch: tuple[float, float] | None = None  # ends of a stretch [s]; None shows everything that is kept
    buckets: int = 400  # of time across a strip
    shown: str = ONE_STEP  # ``one_step`` or ``free_run``
    epoch: str = ""  # of the answer that it has; with the same one it lacks only what is newer
    have: Mapping[str, float] = field(default_factory=dict)  # newest sample of each stream that it has [s]

    @classmethod
    def read(cls, given: Mapping[str, str]) -> Question:
        """Read what a browser has sent.

        `given`: ``follow``, or ``start`` and ``stop``, or neither; ``buckets``, ``shown``, ``epoch``, and ``have`` as
        ``stream:seconds`` with commas between.
        Raises InputError: it makes no sense.
        """
        try:
            follow = float(given["follow"]) if "follow" in given else None
            stretch = (float(given["start"]), float(given["stop"])) if "start" in given else None
            buckets = int(given.get("buckets", cls.buckets))
            pairs = (one.split(":") for one in given.get("have", "").split(",") if one)
            have = {name: float(seconds) for name, seconds in pairs}
        except (KeyError, ValueError) as error:
            raise InputError(f"the strips cannot be asked for like this: {error}") from error
        ends = (0.0, follow) if follow is not None else stretch
        sane = ends is None or (all(map(math.isfinite, ends)) and 0.0 < ends[1] - ends[0] <= LONGEST)
        shown = given.get("shown", ONE_STEP)
        if not sane or shown not in SHOWN or not all(map(math.isfinite, have.values())):
            raise InputError("the strips cannot be asked for like this: no such stretch or model")
        return cls(follow, stretch, min(max(buckets, FEWEST), MOST), shown, given.get("epoch", ""), have)


def answer(signals: Signals, question: Question) -> bytes:
    """Return what a browser lacks.

    Returns: length of the head (32 bits), the head as JSON, and for each of its ``streams`` the ``count`` instants [s]
    as 64-bit floats and its ``columns`` one after the other as 32-bit floats; all little-endian, head and streams
    filled up to multiples of 8 bytes. The samples of a stream replace those that the browser has from the first of them
    on; where ``whole`` is true, all of them.
    """
    start, stop = _stretch(signals, question)
    model, residual = SHOWN[question.shown]
    roles = {name: name for name in ("measured", "model", "residual", "command", "reference")}
    roles |= {"model": model, "residual": residual}
    ends = "newest" if question.follow is not None else f"{start}:{stop}"
    epoch = f"{signals.version} {question.shown} {(stop - start):.9g} {question.buckets} {ends}"
    known = {roles[name]: seconds for name, seconds in question.have.items() if name in roles}
    whole = question.epoch != epoch
    view = signals.view(start, stop, question.buckets, streams=roles.values(), since=None if whole else known)
    head = {
        "epoch": epoch,
        "whole": whole,
        "start": start,
        "stop": stop,
        "band": [float(half) if math.isfinite(half) else None for half in view.band],
        "streams": [
            {
                "name": role,
                "count": len(view.points[stream][0]),
                "columns": view.points[stream][1].shape[1],
                "newest": view.newest.get(stream),
            }
            for role, stream in roles.items()
        ],
    }
    text = _filled(json.dumps(head).encode(), b" ", 4)
    return struct.pack("<I", len(text)) + text + b"".join(_packed(*view.points[one]) for one in roles.values())


def _stretch(signals: Signals, question: Question) -> tuple[float, float]:
    if question.follow is not None:
        newest = signals.newest
        stop = 0.0 if newest is None else signals.seconds(newest)
        return stop - question.follow, stop
    start, stop = question.stretch or signals.span
    return start, max(stop, start + 1e-6)


def _packed(time: Array, values: Array) -> bytes:
    # Single precision is finer than a screen, and half of what has to be sent; for the time of a long run it is not.
    columns = np.ascontiguousarray(values.T, dtype="<f4").tobytes()
    return _filled(time.astype("<f8").tobytes() + columns, b"\0")


def _filled(data: bytes, by: bytes, before: int = 0) -> bytes:
    return data + by * (-(before + len(data)) % ALIGNMENT)
