"""The signals that would end a process at once, and that it answers itself to end in order."""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Iterator
from types import FrameType

# Not to be caught, of another meaning, or raised by a fault to which a handler of Python's would only return.
_SPARED = {
    getattr(signal, f"SIG{name}")
    for name in (
        *("KILL", "STOP", "TSTP", "TTIN", "TTOU", "CONT", "CHLD", "URG", "WINCH"),
        *("PIPE", "XFSZ", "ALRM", "SEGV", "BUS", "FPE", "ILL"),
    )
    if hasattr(signal, f"SIG{name}")
}


def ending_signals() -> list[int]:
    """Return the numbers of the signals to answer; without SIGHUP where `nohup` has it ignored."""
    ends = sorted(set(signal.valid_signals()) - _SPARED)
    return [number for number in ends if number != signal.SIGHUP or signal.getsignal(number) != signal.SIG_IGN]


@contextlib.contextmanager
def event_on_ending_signal() -> Iterator[threading.Event]:
    """Turn the ending signals into an event, so that the work ends in order.

    Only the main thread can; in another one the event is never set.
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
