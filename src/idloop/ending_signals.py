"""Signals that end a process, handled so that it ends in order."""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Iterator
from types import FrameType

# Signals that cannot be caught, have another meaning, or report a fault to which a Python handler would return.
_SPARED = {
    getattr(signal, f"SIG{name}")
    for name in (
        *("KILL", "STOP", "TSTP", "TTIN", "TTOU", "CONT", "CHLD", "URG", "WINCH"),
        *("PIPE", "XFSZ", "ALRM", "SEGV", "BUS", "FPE", "ILL"),
    )
    if hasattr(signal, f"SIG{name}")
}


def ending_signals() -> list[int]:
    """Return the numbers of the signals to handle; without SIGHUP where `nohup` ignores it."""
    ends = sorted(set(signal.valid_signals()) - _SPARED)
    return [number for number in ends if number != signal.SIGHUP or signal.getsignal(number) != signal.SIG_IGN]


@contextlib.contextmanager
def event_on_ending_signal() -> Iterator[threading.Event]:
    """Turn the ending signals into an event, so that the work ends in order.

    Only in the main thread; in another one the event is never set.
    """
    ended = threading.Event()

    def on_signal(number: int, frame: FrameType | None) -> None:
        ended.set()

    if threading.current_thread() is not threading.main_thread():
        yield ended
        return
    previous = {number: signal.signal(number, on_signal) for number in ending_signals()}
    try:
        yield ended
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler)
