"""The page's source for recordings: the same page without a graph, the work done in a process of its own."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from idloop.errors import InputError
from idloop.reporting.use import FITTED, UNSEEN
from idloop.reporting.workbench.assessment import assess
from idloop.reporting.workbench.desk import Desk
from idloop.reporting.workbench.signals import Signals
from idloop.reporting.workbench.source import OK, Board, Missing, Note, Snapshot
from idloop.reporting.workbench.steps import Found, Study, add, find_missing, suggest

if TYPE_CHECKING:
    from idloop.diagnosis import Diagnosis, Ladder
    from idloop.physics import Model
    from idloop.records import Record

Keep = Callable[["Ladder"], None]


class OfflineSource:
    """Recordings and a model; implements `idloop.reporting.workbench.source.Source`.

    Parameters
    ----------
    model : Model
    study : Study
        Data and how they are judged.
    ladder : Ladder, optional
        To go on with.
    keep : callable, optional
        Called with the ladder after every step.
    """

    def __init__(self, model: Model, study: Study, ladder: Ladder | None = None, keep: Keep | None = None) -> None:
        self._model = model if ladder is None else ladder.model
        self._study = study
        self._keep = keep
        self._found: Diagnosis | None = None
        # What the fits do not see says most about the model: it is shown first.
        self._records: Sequence[Record] = (*study.validation, *study.records)
        names = [
            f"{record.name} ({UNSEEN if number < len(study.validation) else FITTED})"
            for number, record in enumerate(self._records)
        ]
        longest = max(max(r.time.size, r.input_time.size) for r in self._records)
        self.signals = Signals(model, capacity=longest)
        self.signals.load(self._records[0])
        self.board = Board(
            Snapshot(title=model.name, effects=tuple(self._model.effect_names), ladder=ladder, recordings=tuple(names))
        )
        self._desk = Desk(self.board)
        self._desk.order("comparing model and record", self._assess)

    def close(self) -> None:
        """End the worker."""
        self._desk.close()

    def order(self, verb: str, what: str = "") -> str:
        """Start an order, see `idloop.reporting.workbench.source.Source`."""
        if verb == "diagnose":
            self._desk.order("looking for what is missing", self._diagnose)
        elif verb == "add":
            if not what:
                raise InputError("no effect is named")
            self._desk.order(f"adding {what}", lambda desk: self._add(desk, what))
        elif verb == "undo":
            ladder = self.board.snapshot.ladder
            if ladder is None:
                raise InputError("there is no step to take back")
            shorter = ladder.undo()
            self._desk.order("taking the last step back", lambda desk: self._climb(desk, shorter))
        elif verb == "experiment":
            if self._found is None or self._found.verdict == "adequate":
                raise InputError("nothing is undecided: find what is missing first")
            self._desk.order("working out the next experiment", self._suggest)
        elif verb in ("assess", "refit"):
            self._desk.order("comparing model and record", self._assess)
        elif verb == "show":
            if not what.isdigit() or int(what) >= len(self._records):
                raise InputError(f"there is no recording {what}")
            self._desk.order(f"reading {self._records[int(what)].name}", lambda desk: self._show(desk, int(what)))
        else:
            raise InputError("recordings have no motor: this works on a live graph only")
        return f"{self._desk.busy or 'done'}"

    def stop(self) -> str:
        """There is nothing to stop."""
        return "recordings have no motor"

    # jobs, on the desk's thread

    def _assess(self, desk: Desk) -> None:
        record = self._records[self.board.snapshot.shown]
        found = desk.work(assess, self._model, record)
        self.signals.show(found, every=True)
        self.board.change(assessment=found)

    def _show(self, desk: Desk, number: int) -> None:
        self.signals.load(self._records[number])
        self.board.change(shown=number, assessment=None)
        self._assess(desk)

    def _diagnose(self, desk: Desk) -> None:
        found: Found = desk.work(find_missing, self._study, self._model, self.board.snapshot.ladder)
        diagnosis = self._found = found.diagnosis
        first = self.board.snapshot.ladder is None
        self._model = found.ladder.model if first else self._model
        self.board.change(
            missing=Missing(
                diagnosis.verdict,
                "",
                diagnosis.candidates,
                diagnosis.set,
                diagnosis.pair or (),
                diagnosis.untestable,
                diagnosis.gate.findings,
                diagnosis.unknown,
                passed_over=diagnosis.passed_over,
            ),
            looks=self.board.snapshot.looks + 1,
            pictures=found.pictures,
            ladder=found.ladder,
            suggested=None,
            suggestion=None,
        )
        self._kept(found.ladder)
        if first:  # its parameters are fitted now
            self._assess(desk)

    def _add(self, desk: Desk, name: str) -> None:
        ladder = desk.work(add, self._study, self._model, self.board.snapshot.ladder, self._found, name)
        self._climb(desk, ladder)

    def _climb(self, desk: Desk, ladder: Ladder) -> None:
        self._model, self._found = ladder.model, None
        self.board.change(
            ladder=ladder,
            effects=tuple(ladder.model.effect_names),
            missing=None,
            pictures={},
            suggested=None,
            suggestion=None,
        )
        self._kept(ladder)
        self._assess(desk)

    def _suggest(self, desk: Desk) -> None:
        found = desk.work(suggest, self._study, self._found)
        if found is None:
            self.board.change(note=Note("nothing is undecided that an experiment could settle", OK))
        else:
            self.board.change(suggested=found.to_dict(), suggestion=found)

    def _kept(self, ladder: Ladder) -> None:
        if self._keep is not None:
            self._keep(ladder)
