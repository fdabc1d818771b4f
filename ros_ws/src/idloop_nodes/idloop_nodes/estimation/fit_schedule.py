"""Which window is fitted when."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from idloop_nodes.estimation.fit_jobs import FitJob
from idloop_nodes.parameters import NodeParameters
from idloop_nodes.streams.sample_buffer import SECOND, DataBook

if TYPE_CHECKING:
    from idloop.physics import Model
    from idloop_nodes.estimation.worker import Worker

SHORTEST = 20  # samples below which a window is not fitted


class FitSchedule:
    """Orders a fit of a sliding window every `fit_period`, judged on the samples after the window.

    Parameters
    ----------
    parameters : NodeParameters
        window, validation, fit_period, criterion, sample_time.
    book : DataBook
    worker : Worker
    numbers : callable
        Returns the number of the next job.
    """

    def __init__(self, parameters: NodeParameters, book: DataBook, worker: Worker, numbers: Callable[[], int]) -> None:
        self._parameters = parameters
        self._book = book
        self._worker = worker
        self._numbers = numbers
        self._next: int | None = None
        self._period_ns = round(parameters["sample_time"] * SECOND)

    def restart(self) -> None:
        """Begin anew with the next sample."""
        self._next = None

    @property
    def due(self) -> int | None:
        """Stamp after the last sample of the next window and its validation; None when no fit is planned."""
        return self._next if self._parameters["fit_period"] else None

    @property
    def spans(self) -> tuple[int, int]:
        """Length of a window and of its validation [ns]."""
        return round(self._parameters["window"] * SECOND), round(self._parameters["validation"] * SECOND)

    def follow(self, model: Model, last: int) -> None:
        """Order what is due after the sample `last` [ns]."""
        window, validation = self.spans
        period = round(self._parameters["fit_period"] * SECOND)
        if not period or self._book.first is None:
            return
        if self._next is None:
            self._next = self._book.first + window + validation
        # A window ends with the sample before its end stamp; half a period keeps rounding out.
        while last + self._period_ns // 2 >= self._next - self._period_ns:
            self._submit(model, self._next - validation - window, self._next - validation, self._next)
            self._next += period

    def fit_now(self, model: Model, last: int | None) -> str:
        """Fit what there is, a part of it kept for the judgement; return what was started."""
        if self._book.first is None or last is None:
            return "no samples yet"
        window, validation = self.spans
        end = last + self._period_ns
        have = min(end - self._book.first, window + validation)
        return self._submit(model, end - have, end - have * validation // (window + validation), end)

    def _submit(self, model: Model, start: int, cut: int, end: int) -> str:
        fit_record, validation_record = self._book.split(model, start, cut, end)
        if min(fit_record.time.size, validation_record.time.size) < SHORTEST:
            return "too few samples"
        number = self._numbers()
        criterion = self._parameters["criterion"]
        self._worker.submit(FitJob(number, model, criterion, fit_record, validation_record, (start, cut), (cut, end)))
        return f"fit {number} of {(cut - start) / SECOND:.1f} s, judged on {(end - cut) / SECOND:.1f} s"
