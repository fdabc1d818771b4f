"""The estimator's samples, cut into records on request."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from idloop.records.bags.cdr import SECOND

if TYPE_CHECKING:
    from idloop.physics import Model
    from idloop.records import Finding, Record

Row = tuple[float, ...]
Span = tuple[int, int]


BEFORE_ALL = -(1 << 63)  # older than any stamp
MOST_NEW = 256  # rows that wait to be stored together: one by one, each costs as much as its decoding


class SampleStore:
    """Rows of so many numbers with stamps in nanoseconds, strictly increasing."""

    def __init__(self, columns: int) -> None:
        self._stamps = np.zeros(1024, dtype=np.int64)
        self._rows = np.zeros((1024, columns))
        self._start = self._stop = 0
        self._newest = BEFORE_ALL
        self._new_stamps: list[int] = []
        self._new_rows: list[tuple[float, ...]] = []

    def __len__(self) -> int:
        return self._stop - self._start + len(self._new_stamps)

    def append(self, stamp: int, row: tuple[float, ...]) -> None:
        """Add a row; one that is not newer than the last is left out."""
        if stamp <= self._newest:
            return
        self._newest = stamp
        self._new_stamps.append(stamp)
        self._new_rows.append(row)
        if len(self._new_stamps) == MOST_NEW:
            self._store_new()

    def _store_new(self) -> None:
        count = len(self._new_stamps)
        if not count:
            return
        if self._stop + count > len(self._stamps):
            self._make_room(count)
        part = slice(self._stop, self._stop + count)
        self._stamps[part], self._rows[part] = self._new_stamps, self._new_rows
        self._stop += count
        self._new_stamps, self._new_rows = [], []

    def window(self, first: int, last: int, before: bool = False) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Return copies of stamps (n,) and rows (n, c) in [first, last), with the row `before` that still holds."""
        self._store_new()
        stamps = self._stamps[self._start : self._stop]
        low = int(np.searchsorted(stamps, first))
        if before and low > 0 and (low == len(stamps) or stamps[low] > first):
            low -= 1
        part = slice(self._start + low, self._start + int(np.searchsorted(stamps, last)))
        return self._stamps[part].copy(), self._rows[part].copy()

    def take_back(self, stamp: int) -> None:
        """Drop rows from `stamp` on: their sender has announced them again."""
        if stamp > self._newest:
            return
        self._store_new()
        stamps = self._stamps[self._start : self._stop]
        self._stop = self._start + int(np.searchsorted(stamps, stamp))
        self._newest = int(self._stamps[self._stop - 1]) if self._stop > self._start else BEFORE_ALL

    def forget(self, before: int) -> None:
        """Drop rows older than `before`, all but one: a held value stays known."""
        self._store_new()
        stamps = self._stamps[self._start : self._stop]
        self._start += max(0, int(np.searchsorted(stamps, before)) - 1)

    def clear(self) -> None:
        """Drop everything."""
        self._start = self._stop = 0
        self._newest = BEFORE_ALL
        self._new_stamps, self._new_rows = [], []

    def _make_room(self, count: int) -> None:
        size = self._stop - self._start
        stamps, rows = self._stamps, self._rows
        if size + count > len(stamps) // 2:
            room = 2 * max(len(stamps), count)
            self._stamps = np.zeros(room, dtype=np.int64)
            self._rows = np.zeros((room, rows.shape[1]))
        self._stamps[:size] = stamps[self._start : self._stop]
        self._rows[:size] = rows[self._start : self._stop]
        self._start, self._stop = 0, size


class SampleBuffer:
    """Commands, measurements and references by stamp."""

    def __init__(self, outputs: int) -> None:
        self.first: int | None = None  # stamp of the first measurement that was worked on [ns]
        # As far as records have shown: velocities that the driver computes from the position, or that are none of it
        self.computed: tuple[Finding, ...] = ()
        self.wrong: tuple[Finding, ...] = ()
        self.commands = SampleStore(1)
        self.outputs = SampleStore(outputs)
        self.references = SampleStore(2)

    def announce(self, stamp: int, row: Row) -> None:
        """Take in a reference; one that is announced again replaces everything from its stamp on."""
        self.references.take_back(stamp)
        self.references.append(stamp, row)

    def clear(self) -> None:
        """Forget everything: a new run begins."""
        self.first = None
        for store in (self.commands, self.outputs, self.references):
            store.clear()

    def forget(self, before: int) -> None:
        """Forget what is older, but not the values that still hold."""
        for store in (self.commands, self.outputs, self.references):
            store.forget(before)

    def split(self, model: Model, start: int, cut: int, stop: int) -> tuple[Record, Record]:
        """Return the samples from `start` and from `cut` [ns] to before `stop`: what is fitted, and what judges.

        A velocity that one of all records has shown to be computed, or to be none of the position, counts as such from
        then on: the next window may show too little motion for that, and what is fitted to must not change with it.
        """
        from idloop.records.align import output_scales
        from idloop.records.inspection.differenced import differenced
        from idloop.records.inspection.velocity_check import KIND, without_wrong_velocities

        both = [self.record(model, *span) for span in ((start, cut), (cut, stop))]
        both = without_wrong_velocities(both, output_scales(model), self.wrong)
        self.wrong = tuple(finding for record in both for finding in record.findings if finding.kind == KIND)
        records = []
        for record in both:
            self.computed = differenced(replace(record, findings=self.computed))
            records.append(replace(record, findings=(*self.computed, *record.findings)))
        return records[0], records[1]

    def record(self, model: Model, start: int, stop: int) -> Record:
        """Return the samples from `start` to before `stop` [ns] as a record of a model."""
        from idloop.records import Record

        command_stamps, command = self.commands.window(start, stop, before=True)
        stamps, output = self.outputs.window(start, stop)
        reference_stamps, reference = self.references.window(start, stop, before=True)
        followed = len(reference_stamps) > 0
        return Record(
            name=f"{(start - (self.first or 0)) / SECOND:g} s",
            input_time=(command_stamps - start) / SECOND,
            input=command[:, 0],
            time=(stamps - start) / SECOND,
            output=output,
            input_name=model.input.name,
            input_unit=model.input.unit,
            output_names=tuple(model.output_names),
            output_units=tuple(output.unit for output in model.outputs),
            reference_time=(reference_stamps - start) / SECOND if followed else None,
            reference=reference if followed else None,
            start_ns=start,
        )


class DiagnosisData:
    """The stretches of data that a diagnosis rests on: the newest normal one, and the experiments.

    Each is split in two: the first part is fitted, the second judges.
    """

    MAXIMUM_EXPERIMENTS = 4

    def __init__(self) -> None:
        self._base: tuple[Record, Record, Span] | None = None
        self._experiments: list[tuple[Record, Record, Span]] = []

    def clear(self) -> None:
        """Forget everything."""
        self._base = None
        self._experiments.clear()

    @property
    def experiments(self) -> int:
        """Experiments that are in."""
        return len(self._experiments)

    @property
    def _all(self) -> list[tuple[Record, Record, Span]]:
        return ([] if self._base is None else [self._base]) + self._experiments

    @property
    def records(self) -> tuple[Record, ...]:
        """What is fitted."""
        return tuple(one[0] for one in self._all)

    @property
    def validation(self) -> tuple[Record, ...]:
        """What judges."""
        return tuple(one[1] for one in self._all)

    @property
    def spans(self) -> tuple[Span, ...]:
        """Stamps of the stretches [ns]."""
        return tuple(one[2] for one in self._all)

    def renew(self, buffer: SampleBuffer, model: Model, end: int, length: int, share: float, shortest: int) -> bool:
        """Take the newest normal stretch up to `end`, if it is new and long enough; return whether there is any."""
        if buffer.first is None:
            return False
        start = max([buffer.first, end - length, *(span[1] for _, _, span in self._experiments)])
        # After an experiment the normal stretch before it serves until the new one is as good.
        if self._base is None or end - start >= 0.75 * (self._base[2][1] - self._base[2][0]):
            self._base = self._split(buffer, model, (start, end), share, shortest) or self._base
        return bool(self._all)

    def add_experiment(self, buffer: SampleBuffer, model: Model, span: Span, share: float, shortest: int) -> bool:
        """Take in an experiment; return whether there was enough of it."""
        one = self._split(buffer, model, span, share, shortest)
        if one is None:
            return False
        self._experiments = [*self._experiments, one][-self.MAXIMUM_EXPERIMENTS :]
        return True

    @staticmethod
    def _split(
        buffer: SampleBuffer, model: Model, span: Span, share: float, shortest: int
    ) -> tuple[Record, Record, Span] | None:
        start, stop = span
        cut = stop - round((stop - start) * share)
        train, judge = buffer.split(model, start, cut, stop)
        if min(train.time.size, judge.time.size) < shortest or not (train.input.size and judge.input.size):
            return None
        return train, judge, span
