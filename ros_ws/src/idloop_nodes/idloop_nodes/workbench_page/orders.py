"""Orders of the page as service calls to the other nodes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from idloop.reporting.terms import effect_words
from idloop.reporting.workbench.state import OK, WARN, Activity, Note, State
from idloop_nodes.service_calls import ServiceCalls
from idloop_nodes.workbench_page.motor_stop import MotorStop
from idloop_nodes.workbench_page.source import STOP

if TYPE_CHECKING:
    from collections.abc import Sequence

# Services of the estimator by the page's verb.
SERVICES = {
    "diagnose": "diagnose",
    "undo": "undo",
    "experiment": "run_suggested_experiment",
    "refit": "refit",
}
# Orders after which the estimator is at work until its next result.
ACTIVITIES = {
    "diagnose": "looking for what is missing",
    "add": "adding {}",
    "undo": "taking the last step back",
    "experiment": "working out the next experiment",
}


class PageOrders:
    """Calls the services of estimator, excitation, controller and bridge.

    `page`: of the page; `estimator`, `excitation`: names of the nodes; `guards`: nodes that can stop the motor, the
    nearest to it first; `holds_position`: the command is a position. Attributes: `pending`: an order was sent that the
    health of the estimator does not show yet.
    """

    def __init__(
        self,
        calls: ServiceCalls,
        page: State,
        estimator: str,
        excitation: str,
        guards: Sequence[str],
        *,
        holds_position: bool,
    ) -> None:
        self.pending = False
        self._calls, self._page = calls, page
        self._estimator, self._excitation = estimator, excitation
        self.motor = MotorStop(calls, page, guards, self._start_excitation, holds_position=holds_position)
        calls.expect(
            *(f"{excitation}/{name}" for name in ("stop", "start")),
            *(f"{estimator}/{name}" for name in ("add_best_effect", *SERVICES.values())),
        )

    def carry_out(self, verb: str, what: str) -> None:
        """Carry out one order of the page, see `idloop.reporting.workbench.state.Source`."""
        if verb == STOP:
            self.motor.stop()
            self._calls.trigger(f"{self._excitation}/stop", lambda done, text: None)
            return
        if verb == "reset":
            self.motor.reset()
            return
        if verb == "automatic":
            self._switch(*what.split())
            return
        if verb in ACTIVITIES:
            self.pending = True
            self._page.change(activity=Activity(ACTIVITIES[verb].format(effect_words(what))), note=None)
        if verb == "add" and not self._is_best(what):
            self._calls.add_effect(self._estimator, what, self._answered)
            return
        service = "add_best_effect" if verb == "add" else SERVICES[verb]
        self._calls.trigger(f"{self._estimator}/{service}", self._undone if verb == "undo" else self._answered)

    def _switch(self, what: str, to: str) -> None:
        """Switch an automatic action of the estimator; its next health message shows that it has."""
        name = f"auto_{what}"
        message = f"{self._estimator}: {name} is {to}"
        self._calls.set_parameter(self._estimator, name, to == "on", message, self._answered)

    def _is_best(self, effect: str) -> bool:
        """Whether the estimator would add this effect of its own accord."""
        missing = self._page.snapshot.missing
        return missing is not None and bool(missing.set) and missing.candidates[0].name == effect

    def _answered(self, done: bool, text: str) -> None:
        self.pending = False  # from now on the health of the estimator shows its activity
        if not done:
            self._page.change(note=Note(text, WARN), activity=None)

    def _undone(self, done: bool, text: str) -> None:
        self._answered(done, text)
        if done and self._page.snapshot.automatic:
            message = "The graph adds nothing and moves nothing by itself any more, or the step would come back."
            self._page.change(automatic=(), note=Note(message, OK))

    def _start_excitation(self) -> None:
        self._calls.trigger(f"{self._excitation}/start", lambda done, text: None)
