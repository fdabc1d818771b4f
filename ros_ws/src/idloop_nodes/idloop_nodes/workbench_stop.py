"""The page's stop: every node between a command and the motor is told; what none confirms is said to be no stop."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

from idloop.workbench.source import ERROR, OK, WARN, Board, Note
from idloop_nodes.workbench_calls import Calls

PATIENCE = 5.0  # seconds after which a stop that nobody has confirmed is said to be none


class MotorStop:
    """Stops the motor through each of some nodes and lets it go again.

    The motor counts as stopped as soon as one of them says so, and as released when none holds it any more.

    Parameters
    ----------
    calls : Calls
    board : Board
        Is told whether the motor is stopped.
    nodes : sequence of str
        Nodes with the services ``~/emergency_stop`` and ``~/reset``, the nearest to the motor first.
    released : callable
        Called when a reset has let the motor go.
    """

    def __init__(self, calls: Calls, board: Board, nodes: Sequence[str], released: Callable[[], None]) -> None:
        self._calls = calls
        self._board = board
        self._nodes = tuple(nodes)
        self._when_released = released
        self._latched: set[str] = set()
        calls.expect(*(f"{node}/{service}" for node in nodes for service in ("emergency_stop", "reset")))

    def stop(self) -> None:
        """Tell all of them at once."""
        refused: list[str] = []

        def answered(node: str, done: bool, text: str) -> None:
            if done:
                self._latched.add(node)
                self._board.change(stopped=True, note=None)  # the page has a banner for it
                return
            refused.append(text)
            note = Note(text, WARN)
            if len(refused) == len(self._nodes):
                note = Note(f"THE MOTOR WAS NOT STOPPED: {' '.join(refused)} Use the switch of the drive.", ERROR)
            self._board.change(note=note)

        self._tell("emergency_stop", answered, PATIENCE)

    def reset(self) -> None:
        """Let the motor go, where every one of them does."""
        answers: list[bool] = []

        def answered(node: str, done: bool, text: str) -> None:
            answers.append(done)
            if not done:
                self._board.change(note=Note(f"{node}: {text}", WARN))
                return
            self._latched.discard(node)
            if len(answers) == len(self._nodes) and all(answers):
                self._board.change(stopped=False, note=Note(text, OK))
                self._when_released()

        self._tell("reset", answered)

    def hear(self, node: str, check: str, message: str) -> None:
        """Take in what a health message says: somebody else may have stopped the motor."""
        if check == "safety" and node in self._nodes:
            (self._latched.add if "emergency" in message else self._latched.discard)(node)
            self._board.change(stopped=bool(self._latched))

    def _tell(self, service: str, answered: Callable[[str, bool, str], None], patience: float | None = None) -> None:
        for node in self._nodes:
            self._calls.trigger(f"{node}/{service}", partial(answered, node), patience)
