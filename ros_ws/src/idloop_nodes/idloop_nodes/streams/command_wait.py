"""How long a measurement waits for the command that held at its stamp."""

from __future__ import annotations

PERIODS = 100  # after which a missing command no longer holds a measurement up
SILENCE = 1.0  # seconds without any command: in simulated time only this tells a missing one from a late one
EVER = 1 << 62  # later than any stamp


class CommandWait:
    """Stamps up to which the commands are known, or will not be known any more.

    In real time a measurement that is a hundred periods old has waited long enough. In lock-step nothing runs ahead of
    the commands, however long they take, so that equal runs give equal results; only a recording that lacks commands
    shows measurements far beyond the last one, or its end, and then nothing comes.

    `period_ns`: of the samples; `now`: of a clock that never jumps [s].
    """

    def __init__(self, period_ns: int, lockstep: bool, now: float) -> None:
        self._patience = PERIODS * period_ns
        self._lockstep = lockstep
        self._newest = now

    def update(self, now: float) -> None:
        """Note that a command has come."""
        self._newest = now

    def known_until(self, command: int | None, output: int, end: int | None, now: float) -> int:
        """Newest stamp whose command is settled [ns].

        `command`: stamp of the newest command; `output`: stamp of the newest measurement; `end`: stamp after which
        nothing comes, where that is known; `now`: [s].
        """
        given_up = output - self._patience
        if self._lockstep and now - self._newest < SILENCE:
            given_up = -1
        elif end is not None and output >= end and now - self._newest >= SILENCE:
            given_up = EVER
        return given_up if command is None else max(command, given_up)
