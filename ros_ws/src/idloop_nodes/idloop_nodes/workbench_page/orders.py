"""Orders of the page as service calls to the other nodes; "stopped" is shown only when it is confirmed."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial

from idloop.reporting.terms import effect_words
from idloop.reporting.workbench.state import ERROR, FREE, OK, RELEASING, SENT, STOPPED, WARN, Activity, Note, State
from idloop_nodes.service_calls import ServiceCalls
from idloop_nodes.workbench_page.source import STOP

# Services of the estimator by the page's verb.
SERVICES = {
    "diagnose": "diagnose",
    "undo": "undo",
    "design": "suggest_experiment",
    "experiment": "run_suggested_experiment",
    "refit": "refit",
}
# Orders after which the estimator is at work until its next result.
ACTIVITIES = {
    "diagnose": "looking for what is missing",
    "add": "adding {}",
    "undo": "taking the last step back",
    "design": "working out the next experiment",
    "experiment": "starting the experiment",
}


TIMEOUT = 5.0  # seconds after which a stop without confirmation counts as failed
FRESH = 1.0  # seconds after which a command says nothing about the present
HEALTH_LIMIT = 3.5  # seconds after which a health message of the last node does so; it comes every second
HOLD = 0.3  # seconds for which a position that is commanded must not change to count as held
# Health that was on its way while a node confirmed the stop is older than its answer.
ON_ITS_WAY = 2.0


@dataclass(eq=False)
class MotorStop:
    """Stops the motor through each of some nodes and lets it go again.

    The motor counts as stopped while the last node before it reports the stop and its commands are neutral. It counts
    as released when no node holds it any more.
    """

    calls: ServiceCalls
    page: State  # receives the state of the stop
    nodes: Sequence[str]  # nodes with ``~/emergency_stop`` and ``~/reset``, the nearest to the motor first
    released: Callable[[], None]  # called when a reset has let the motor go
    holds_position: bool = False  # the command is a position: neutral is one that is held, not zero
    clock: Callable[[], float] = time.monotonic  # steady time [s]

    def __post_init__(self) -> None:
        """Look for the services before they are needed."""
        self._latched: dict[str, float] = {}  # nodes that hold the motor, and when they last reported it
        self._confirmed: dict[str, float] = {}  # when they answered the order
        self._asked = self._releasing = False
        self._command: tuple[float, float, float] | None = None  # value, since when it is that, when it came last
        self.calls.expect(*(f"{node}/{service}" for node in self.nodes for service in ("emergency_stop", "reset")))

    def stop(self) -> None:
        """Call all of them at once."""
        refused: list[str] = []
        self._asked, self._releasing = True, False
        self._command = None  # earlier commands do not count
        self._confirmed.clear()

        def answered(node: str, done: bool, text: str) -> None:
            if done:
                self._latched[node] = self._confirmed[node] = self.clock()
                self.page.change(note=None)  # the page has a banner for it
                self.poll()
                return
            refused.append(text)
            note = Note(text, WARN)
            if len(refused) == len(self.nodes):
                note = Note(f"THE MOTOR WAS NOT STOPPED: {' '.join(refused)} Use the switch of the drive.", ERROR)
            self.page.change(note=note)

        self._call("emergency_stop", answered, TIMEOUT)
        self.poll()

    def reset(self) -> None:
        """Release the motor through all of them."""
        answers: list[bool] = []
        self._releasing = True

        def answered(node: str, done: bool, text: str) -> None:
            answers.append(done)
            if done:
                self._latched.pop(node, None)
            else:
                self.page.change(note=Note(f"{node}: {text}", WARN))
            if len(answers) == len(self.nodes):
                self._releasing = False
                if all(answers):
                    self._asked = False
                    self.page.change(note=Note(text, OK))
                    self.released()
            self.poll()

        self._call("reset", answered)
        self.poll()

    def update(self, node: str, check: str, message: str) -> None:
        """Take in a health message: another user may have stopped the motor, or released it."""
        if check != "safety" or node not in self.nodes:
            return
        now = self.clock()
        if "emergency" in message:
            self._latched[node] = now
        elif node in self._latched and now - self._confirmed.get(node, now - ON_ITS_WAY) >= ON_ITS_WAY:
            del self._latched[node]
            self._asked = self._asked and bool(self._latched)
        self.poll()

    def see(self, commands: Iterable[float]) -> None:
        """Take in the newest commands of the motor."""
        now = self.clock()
        for value in commands:
            before = self._command
            self._command = value, before[1] if before is not None and before[0] == value else now, now

    def poll(self) -> None:
        """Put the state of the stop in the page's state."""
        self.page.change(stop=self._state())

    def _state(self) -> str:
        if self._releasing:
            return RELEASING
        if not (self._asked or self._latched):
            return FREE
        now = self.clock()
        confirmed = now - self._latched.get(self.nodes[0], -HEALTH_LIMIT) < HEALTH_LIMIT if self.nodes else False
        return STOPPED if confirmed and self._neutral(now) else SENT

    def _neutral(self, now: float) -> bool:
        if self._command is None:
            return False
        value, since, newest = self._command
        return now - newest < FRESH and (newest - since >= HOLD if self.holds_position else value == 0.0)

    def _call(self, service: str, answered: Callable[[str, bool, str], None], timeout: float | None = None) -> None:
        for node in self.nodes:
            self.calls.trigger(f"{node}/{service}", partial(answered, node), timeout)


@dataclass(eq=False)
class PageOrders:
    """Calls the services of estimator, excitation, controller and bridge."""

    calls: ServiceCalls
    page: State
    # Names of the nodes
    estimator: str
    excitation: str
    guards: Sequence[str]  # nodes that can stop the motor, the nearest to it first
    holds_position: bool  # the command is a position
    pending: bool = False  # an order was sent that the health of the estimator does not show yet

    def __post_init__(self) -> None:
        """Look for the services before they are needed."""
        self.motor = MotorStop(self.calls, self.page, self.guards, self._start_excitation, self.holds_position)
        self.calls.expect(
            *(f"{self.excitation}/{name}" for name in ("stop", "start")),
            *(f"{self.estimator}/{name}" for name in ("add_best_effect", *SERVICES.values())),
        )

    def carry_out(self, verb: str, what: str) -> None:
        """Carry out one order of the page, see `idloop.reporting.workbench.state.Source`."""
        if verb == STOP:
            self.motor.stop()
            self.calls.trigger(f"{self.excitation}/stop", lambda done, text: None)
            return
        if verb == "reset":
            self.motor.reset()
            return
        if verb == "automatic":
            self._switch(*what.split())
            return
        if verb in ACTIVITIES:
            self.pending = True
            self.page.change(activity=Activity(ACTIVITIES[verb].format(effect_words(what))), note=None)
        if verb == "add" and not self._is_best(what):
            self.calls.add_effect(self.estimator, what, self._answered)
            return
        service = "add_best_effect" if verb == "add" else SERVICES[verb]
        self.calls.trigger(f"{self.estimator}/{service}", self._undone if verb == "undo" else self._answered)

    def _switch(self, what: str, to: str) -> None:
        """Switch an automatic action of the estimator; its next health message shows that it has."""
        name = f"auto_{what}"
        message = f"{self.estimator}: {name} is {to}"
        self.calls.set_parameter(self.estimator, name, to == "on", message, self._answered)

    def _is_best(self, effect: str) -> bool:
        """Whether the estimator would add this effect of its own accord."""
        missing = self.page.snapshot.missing
        return missing is not None and bool(missing.set) and missing.candidates[0].name == effect

    def _answered(self, done: bool, text: str) -> None:
        self.pending = False  # from now on the health of the estimator shows its activity
        if not done:
            self.page.change(note=Note(text, WARN), activity=None)

    def _undone(self, done: bool, text: str) -> None:
        self._answered(done, text)
        if done and self.page.snapshot.automatic:
            message = "The graph adds nothing and moves nothing by itself any more, or the step would come back."
            self.page.change(automatic=(), note=Note(message, OK))

    def _start_excitation(self) -> None:
        self.calls.trigger(f"{self.excitation}/start", lambda done, text: None)
