"""The page's source for recordings: the same page without a graph, the work done in a process of its own."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from idloop.errors import InputError
from idloop.reporting.figures.effects import Decided
from idloop.reporting.next_experiment import predicted_motion
from idloop.reporting.terms import FITTED, UNSEEN, effect_words
from idloop.reporting.workbench.assessment import assess
from idloop.reporting.workbench.coordinator import Coordinator
from idloop.reporting.workbench.files import content
from idloop.reporting.workbench.signals import Signals
from idloop.reporting.workbench.state import OK, Evidence, Missing, Note, Snapshot, State, model_version
from idloop.reporting.workbench.steps import Found, Study, add, find_missing, fitted_records, suggest

if TYPE_CHECKING:
    from idloop.diagnosis import Diagnosis, Ladder
    from idloop.physics import Model
    from idloop.records import Record

Keep = Callable[["Ladder"], None]


class OfflineSource:
    """Recordings and a model; implements `idloop.reporting.workbench.state.Source`.

    `study`: data and how they are judged. `ladder`: to go on with. `keep`: called with the ladder after every step.
    `paths`: of the recordings that are fitted, and of those that no fit sees. `model_file`: that holds the model.
    `inspected`: what the inspection says of the recordings that are fitted.
    """

    def __init__(
        self,
        model: Model,
        study: Study,
        ladder: Ladder | None = None,
        keep: Keep | None = None,
        paths: tuple[Sequence[Path], Sequence[Path]] = ((), ()),
        *,
        model_file: Path | None = None,
        inspected: Sequence[str] = (),
    ) -> None:
        self._model = model if ladder is None else ladder.model
        self._study = study
        self._keep = keep
        self._found: Diagnosis | None = None
        # By recording: models that follow one another are looked at by one error.
        self._measures: dict[int, dict[str, str]] = {}
        # What the fits do not see says most about the model: it is shown first.
        self._records: Sequence[Record] = (*study.validation, *study.records)
        uses = [UNSEEN] * len(study.validation) + [FITTED] * len(study.records)
        names = [f"{record.name} ({use})" for record, use in zip(self._records, uses, strict=True)]
        longest = max(max(r.time.size, r.input_time.size) for r in self._records)
        self.signals = Signals(model, capacity=longest)
        self.signals.load(self._records[0])
        self.state = State(
            Snapshot(
                title=model.name,
                model=self._model,
                ladder=ladder,
                recordings=tuple(names),
                # The commands that name them are run beside the files that are taken along.
                bags=tuple(str(path.absolute()) for path in paths[0]),
                validate=tuple(str(path.absolute()) for path in paths[1]),
                options=study.options,
                model_file=("", "") if model_file is None else (str(model_file.absolute()), model_version(self._model)),
                inspected=tuple(inspected),
            )
        )
        self._coordinator = Coordinator(self.state, yields=False)
        self._coordinator.order("comparing model and record", self._assess)

    def close(self) -> None:
        """End the worker."""
        self._coordinator.close()

    def order(self, verb: str, what: str = "") -> str:
        """Start an order, see `idloop.reporting.workbench.state.Source`."""
        if verb == "diagnose":
            self._coordinator.order("looking for what is missing", self._diagnose, waits=True)
        elif verb == "add":
            if not what:
                raise InputError("no effect is named")
            text = effect_words(what)
            self._coordinator.order(f"adding {text}", self._computing(f"+ {text}", lambda: self._add(what)))
        elif verb == "undo":
            ladder = self.state.snapshot.ladder
            if ladder is None:
                raise InputError("there is no step to take back")
            shorter = ladder.undo()
            back = functools.partial(self._climb, shorter, "the last step was taken back")
            self._coordinator.order("taking the last step back", self._computing("the last step taken back", back))
        elif verb == "experiment":
            if self._found is None or self._found.verdict == "adequate":
                raise InputError("nothing is undecided: find what is missing first")
            self._coordinator.order("working out the next experiment", self._suggest)
        elif verb in ("assess", "refit"):
            self._coordinator.order("comparing model and record", self._assess)
        elif verb == "show":
            if not what.isdigit() or int(what) >= len(self._records):
                raise InputError(f"there is no recording {what}")
            show = functools.partial(self._show_model, self._model, int(what))
            self._coordinator.order(f"reading {self._records[int(what)].name}", show)
        else:
            raise InputError("recordings have no motor: this works on a live graph only")
        return self._coordinator.busy or "done"

    def stop(self) -> str:
        """There is nothing to stop."""
        return "recordings have no motor"

    def file(self, name: str) -> bytes:
        """Content of a file, see `idloop.reporting.workbench.state.Source`."""
        return content(name, self.state.snapshot, self._study)

    # jobs, on the coordinator's thread

    def _computing(self, text: str, job: Callable[[], None]) -> Callable[[], None]:
        """A job that makes another model: until it is done the page says so of every number."""

        def run() -> None:
            self.state.change(computing=text)
            try:
                job()
            finally:
                self.state.change(computing="")

        return run

    def _assess(self) -> None:
        self._show_model(self._model)

    def _show_model(self, model: Model, number: int | None = None, **changes: Any) -> None:
        """Assess a model on the recording that is shown, or on another one, and show all that changes at once.

        A page that showed the new ladder first would contradict its own figures while they are computed.
        """
        shown = self.state.snapshot.shown if number is None else number
        found = self._coordinator.work(
            functools.partial(assess, measures=self._measures.get(shown)), model, self._records[shown]
        )
        self._measures.setdefault(shown, found.where.measures)
        self._model = model
        # The page asks for its words less often than for its curves.
        self.state.change(model=model, assessment=found, shown=shown, computing="", **changes)
        if number is not None:
            self.signals.load(self._records[shown])
        self.signals.show(found, every=True)

    def _diagnose(self) -> None:
        if self.state.snapshot.ladder is None:  # its parameters are fitted first, and that is a step of the page
            fitting = f"start: fitted to {fitted_records(self._study)}"
            return self._computing(fitting, self._look_for_effects)()
        return self._look_for_effects()

    def _look_for_effects(self) -> None:
        found: Found = self._coordinator.work(find_missing, self._study, self._model, self.state.snapshot.ladder)
        one = self._found = found.diagnosis
        answer = (one.verdict, "", one.candidates, one.set, one.pair or (), one.untestable, one.gate.findings)
        changes: dict[str, Any] = {
            "missing": Missing(*answer, one.unknown, passed_over=one.passed_over, left=found.left),
            "evidence": recorded_evidence(one, self._study.records),
            "looks": self.state.snapshot.looks + 1,
            "pictures": found.pictures,
            "ladder": found.ladder,
            "suggested": None,
            "suggestion": None,
        }
        if self.state.snapshot.ladder is None:
            why = f"fitted to {fitted_records(self._study)} before effects were looked for"
            self._show_model(found.ladder.model, given=found.given, **changes, **self._said(found.ladder.model, why))
        else:
            self.state.change(**changes)
        self._kept(found.ladder)

    def _add(self, name: str) -> None:
        ladder = self._coordinator.work(add, self._study, self._model, self.state.snapshot.ladder, self._found, name)
        self._climb(ladder, f"{effect_words(name)} was added, and everything fitted to {fitted_records(self._study)}")

    def _climb(self, ladder: Ladder, why: str) -> None:
        self._show_model(
            ladder.model, ladder=ladder, missing=None, evidence=None, pictures={}, suggested=None, suggestion=None,
            **self._said(ladder.model, why),
        )  # fmt: skip
        self._found = None
        self._kept(ladder)

    def _said(self, model: Model, why: str) -> dict[str, Any]:
        """What the page says where a model has other values than the one before it."""
        before, after = model_version(self._model), model_version(model)
        if before == after:
            return {}
        return {"reason": why, "note": Note(f"The model is another one now ({before} → {after}): {why}.", OK)}

    def _suggest(self) -> None:
        found = self._coordinator.work(suggest, self._study, self._found)
        if found.suggestion is not None:
            suggested = {**found.suggestion.to_dict(), "motion": predicted_motion(found.suggestion)}
            self.state.change(suggested=suggested, suggestion=found.suggestion)
        elif found.reason:
            self.state.change(suggested={"text": found.reason}, suggestion=None)
        else:
            self.state.change(note=Note("nothing is undecided that an experiment could settle", OK))

    def _kept(self, ladder: Ladder) -> None:
        if self._keep is not None:
            self._keep(ladder)


def recorded_evidence(found: Diagnosis, records: Sequence[Record]) -> Evidence | None:
    """Return a line for each effect that was evaluated; None where none was.

    `records`: what it was made of: the samples that it scored, of all or some, are spread over their time.
    """
    courses = {
        one.name: one.course
        for one in found.candidates
        if one.course is not None and one.course.log_e and all(map(math.isfinite, one.course.log_e))
    }
    if not courses:
        return None
    # Two effects that show only together have courses of their own where one was evaluated alone.
    samples = next(iter(courses.values())).samples
    courses = {name: course for name, course in courses.items() if course.samples == samples}
    duration = sum(float(record.time[-1] - record.time[0]) for record in records)
    seconds = tuple(duration * one / samples[-1] for one in samples)
    reached = {name: course.decided(found.threshold) for name, course in courses.items()}
    # What the diagnosis has a reason against, or does not find significant beside its scatter, is not decided.
    named = found.best is not None
    decided = {
        name: Decided(seconds[place], samples[place], courses[name].log_e[place])
        for name, place in reached.items()
        if place is not None and named and name not in found.passed_over
    }
    first = min(decided, key=lambda name: (name not in found.set, decided[name].seconds), default=None)
    above = sum(place is not None for place in reached.values())
    line = f"no effect is decided in {duration:.3g} s"
    if first is not None:
        tied = len(found.set) > 1 and not found.pair
        what = f"one of the {len(found.set)} effects that tie" if tied else effect_words(first)
        line = f"{what} is decided after {decided[first].seconds:.3g} of {duration:.3g} s"
    elif above:
        line += f"; the threshold is reached by {above} that {'is' if above < 2 else 'are'} not added"
    lines = {name: course.log_e for name, course in courses.items()}
    return Evidence(line, found.model.effect_names, seconds, lines, found.threshold, decided, recorded=True)
