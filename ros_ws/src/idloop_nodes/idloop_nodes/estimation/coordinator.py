"""Orders to the estimator's worker, and what follows from its answers; no ROS and no mathematics."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from idloop.errors import InputError
from idloop_nodes.codec import LadderSummary, MissingSummary
from idloop_nodes.estimation.diagnosis_jobs import (
    ADD_BEST,
    DESIGN,
    DIAGNOSE,
    EFFECTS,
    SUGGEST,
    UNDO,
    DiagnosisAnswer,
    MotionLimits,
)

MAXIMUM_EXPERIMENTS = 3  # that the estimator orders by itself for one set of effects that tie


@dataclass(frozen=True)
class Autopilot:
    """What the estimator does automatically."""

    diagnose: bool = True
    add: bool = False
    experiment: bool = False

    def __str__(self) -> str:
        """Name what is switched on."""
        return " ".join(name for name in ("diagnose", "add", "experiment") if getattr(self, name))


@dataclass
class Coordinator:
    """The orders under way, and their newest results.

    `submit`: ``submit(verb, state, **more)`` builds a job from the newest data and gives it to the worker; raises
    InputError when there is no data. `hand_over`: ``hand_over(experiment)`` gives an experiment to the excitation;
    `handed_over` or `refused` follows. `ask_limits`: asks the excitation for its limits; `limits_known` or `refused`
    follows. `autopilot`: returns the present `Autopilot`. `log`: receives one line for the user.
    """

    submit: Callable[..., str]
    hand_over: Callable[[str], None]
    ask_limits: Callable[[], None]
    autopilot: Callable[[], Autopilot]
    log: Callable[[str], object]
    state: bytes = b""
    missing: MissingSummary | None = None
    ladder: LadderSummary | None = None
    ordered: str = ""  # verb of the order that the worker has; empty when none
    waiting: str = ""  # what the excitation is being asked for; empty when nothing
    span: tuple[int, int] | None = None  # stamps of a running experiment whose data will be diagnosed [ns]
    _queued_effects: tuple[str, ...] | None = None
    _automatic: int = 0  # experiments ordered automatically since the last added effect
    _asked: tuple[str, ...] | None = None  # what the last of them was to separate
    _designed: str = ""  # experiment that was worked out and not run, for the excitation
    _runs: bool = True  # whether the experiment that is being worked out is run without another order

    @property
    def busy(self) -> bool:
        """Whether an order is under way; an experiment that runs is none."""
        return bool(self.ordered or self.waiting)

    # orders

    def order(self, verb: str, **more: Any) -> str:
        """Give an order; return what was started, or raise InputError: one is under way, nothing to do, or no data."""
        if self.busy:
            raise InputError(f"{self.ordered or self.waiting} is under way: wait for its result")
        if verb == ADD_BEST and (self.missing is None or self.missing.verdict != "missing"):
            raise InputError("no effect is known to be missing: call ~/diagnose first")
        if verb == UNDO and (self.ladder is None or len(self.ladder.steps) < 2):
            raise InputError("there is no step to take back")
        if verb in (SUGGEST, DESIGN):
            if self.span is not None:
                raise InputError("an experiment is running already")
            if self.missing is None or self.missing.verdict in ("", "adequate"):
                raise InputError("nothing is undecided: call ~/diagnose first")
            if verb == SUGGEST and self._designed:
                self._start(self._designed)
                return "the excitation will run the experiment that was worked out"
            self._runs = verb == SUGGEST
            self.waiting = "the suggestion of an experiment"
            self.ask_limits()
            return f"working out the experiment; {'the excitation will run it' if self._runs else 'nothing moves'}"
        return self._submit(verb, **more)

    def _submit(self, verb: str, **more: Any) -> str:
        text = self.submit(verb, self.state, **more)
        self.ordered = verb
        return text

    def set_effects(self, effects: tuple[str, ...]) -> None:
        """Refit with exactly these effects, now or after the order that is under way."""
        self.missing, self._designed = None, ""
        if self.busy:
            self._queued_effects = effects
            return
        try:
            self._submit(EFFECTS, effects=effects)
        except InputError as error:
            self.log(f"no refit: {error}")

    def forget(self) -> None:
        """Forget all results, of an order under way as well: another model, or a new run of the clock."""
        self.state, self.missing, self.ladder, self.span = b"", None, None, None
        self._queued_effects = None
        self._automatic, self._asked, self._designed = 0, None, ""
        if self.ordered:
            self.ordered = "an order for the model before"

    # answers

    def take(self, answer: DiagnosisAnswer) -> DiagnosisAnswer | None:
        """Take in an answer of the worker; None when it is not wanted any more."""
        wanted, self.ordered, self._designed = answer.verb == self.ordered, "", ""
        if self._overtaken() or not wanted:
            return None
        if answer.error:
            self.log(f"{answer.verb}: {answer.error}")
        else:
            self.state = answer.state
        if answer.missing is not None:
            self.missing = answer.missing
        elif answer.verb in (ADD_BEST, UNDO, EFFECTS) and not answer.error:
            self.missing = None
        ladder = answer.ladder
        if ladder is None and answer.error and self.ladder is not None:
            ladder = self.ladder.failed(answer.error)
        if ladder is not None:
            self.ladder = ladder
        return replace(answer, ladder=ladder)

    def _overtaken(self) -> bool:
        """Whether the user has chosen other effects in the meantime; they are fitted now."""
        effects, self._queued_effects = self._queued_effects, None
        if effects is not None:
            self.set_effects(effects)
        return effects is not None

    def go_on(self, answer: DiagnosisAnswer) -> None:
        """Order what follows from an answer."""
        pilot = self.autopilot()
        if answer.verb == SUGGEST:
            self._after_suggestion(answer)
        elif answer.error:
            return
        elif answer.verb == ADD_BEST:
            self._automatic, self._asked = 0, None
            if pilot.add:
                self._try(DIAGNOSE)
        elif answer.verb == DIAGNOSE:
            self._after_diagnosis(pilot)

    def _after_diagnosis(self, pilot: Autopilot) -> None:
        missing = self.missing
        if missing is None:
            return
        undecided = missing.verdict == "not_excited" or (missing.verdict == "missing" and len(missing.set) > 1)
        # What one experiment could not separate, another will not separate either.
        if undecided and pilot.experiment and self._automatic < MAXIMUM_EXPERIMENTS and missing.set != self._asked:
            self._automatic += 1
            self._asked = missing.set
            self._try(SUGGEST)
        elif missing.verdict == "missing" and pilot.add:
            self._try(ADD_BEST)

    def _after_suggestion(self, answer: DiagnosisAnswer) -> None:
        suggested = None if answer.ladder is None else answer.ladder.suggested_experiment
        if answer.error or suggested is None:
            self._without_experiment()
            return
        self.log(f"next experiment: {suggested.get('text', '')}")
        experiment = json.dumps(suggested["experiment"])
        if self._runs:
            self._start(experiment)
        else:
            self._designed = experiment

    def _start(self, experiment: str) -> None:
        self.waiting, self._designed, self._runs = "the start of an experiment", "", True
        self.hand_over(experiment)

    def _without_experiment(self) -> None:
        """Decide without an experiment that was to run."""
        if self._runs and self.autopilot().add and self.missing is not None and self.missing.verdict == "missing":
            self._try(ADD_BEST)

    def _try(self, verb: str) -> None:
        try:
            self.order(verb)
        except InputError as error:
            self.log(str(error))

    # the excitation's answers

    def limits_known(self, limits: MotionLimits) -> None:
        """Work out the experiment within these limits."""
        self.waiting = ""
        if self._overtaken():
            return
        try:
            self._submit(SUGGEST, limits=limits)
        except InputError as error:
            self.refused(str(error))

    def handed_over(self, text: str) -> None:
        """Note that the excitation runs the experiment."""
        self.waiting = ""
        self.log(text)
        self._overtaken()

    def refused(self, reason: str) -> None:
        """Go on without the excitation."""
        self.waiting = ""
        self.log(f"no experiment: {reason}")
        if self.ladder is not None:
            self.ladder = self.ladder.failed(reason)
        if self._overtaken():
            return
        self._without_experiment()
