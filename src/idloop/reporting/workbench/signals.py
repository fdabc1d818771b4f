"""The streams that the page draws: measured, predicted, residual of every output, and the command."""

from __future__ import annotations

import threading
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from idloop.arrays import Array
from idloop.reporting.decimation import extremes
from idloop.reporting.estimates import NORMAL_95
from idloop.reporting.residual_findings import FEWEST, REFUTED
from idloop.reporting.workbench.ring import Ring

if TYPE_CHECKING:
    from idloop.physics import Model
    from idloop.records import Record
    from idloop.reporting.workbench.assessment import Assessment


SECOND = 1_000_000_000
CAPACITY = 130_000  # samples: two minutes at 1 kHz
BAND = NORMAL_95  # standard deviations of the band around a residual of zero, as in every other figure
ENOUGH = 5000  # samples of a residual that say how wide its bulk is
JUMP = SECOND  # a stamp that goes back by more means that a new run has begun
STREAMS = ("measured", "predicted", "residual", "free_run", "free_error", "command", "reference")
RECORDED = ("measured", "command")  # what a record is made of; the others are drawn and no more
SCALARS = ("command", "reference")  # one column; the others have one for each output


@dataclass(frozen=True)
class View:
    """A stretch of all streams with few enough points to draw."""

    # (time, values) by name: by stream; seconds since the start, and shape (m, columns)
    points: dict[str, tuple[Array, Array]]
    # Ends of the stretch [s]
    start: float
    stop: float
    newest: dict[str, float]  # newest sample of each stream in the stretch [s]; absent where there is none
    band: Array  # shape (outputs,): half width of the band around a residual of zero; NaN where nothing is known


class Signals:
    """Bounded buffers of one model's streams; one thread writes, any number read.

    `model`: names and units of input and outputs, and the noise of the sensors.
    `capacity`: samples kept of every stream.
    """

    def __init__(self, model: Model, capacity: int = CAPACITY) -> None:
        self.names = tuple(output.name for output in model.outputs)
        self.units = tuple(output.unit for output in model.outputs)
        self.input_name, self.input_unit = model.input.name, model.input.unit
        self.noise = np.array([np.nan if o.noise is None else float(o.noise) for o in model.outputs])
        # The reference is drawn beside what it commands: the position of the driven joint.
        self.followed = next((i for i, o in enumerate(model.outputs) if o.field == "position"), None)
        self._rings = {
            name: Ring(1 if name in SCALARS else len(self.names), capacity, drawn=name not in RECORDED)
            for name in STREAMS
        }
        self._lock = threading.Lock()
        self.origin: int | None = None
        self.runs = 0
        self._known_band: tuple[tuple[int, ...], Array] | None = None
        # Grows when samples are replaced: until then a reader only lacks those that came since.
        self.version = 0

    @property
    def nbytes(self) -> int:
        """Memory of all buffers [B]; it does not grow."""
        return sum(ring.nbytes for ring in self._rings.values())

    @property
    def newest(self) -> int | None:
        """Stamp of the newest measurement [ns]."""
        return self._rings["measured"].newest

    def extend(self, stream: str, stamps: ArrayLike, values: ArrayLike) -> None:
        """Take in samples of one stream, stamps in nanoseconds."""
        new = np.asarray(stamps, dtype=np.int64).reshape(-1)
        if not len(new):
            return
        with self._lock:
            ring = self._rings[stream]
            if stream == "measured":
                if self.newest is not None and int(new[0]) < self.newest - JUMP:
                    self._begin_again()
                if self.origin is None:
                    self.origin = int(new[0])
            ring.extend(new, values)

    def replace(self, stream: str, stamps: ArrayLike, values: ArrayLike) -> None:
        """Put samples in the place of all that a stream holds."""
        with self._lock:
            self._rings[stream].clear()
            self._rings[stream].extend(stamps, values)
            self.version += 1

    def show(self, assessment: Assessment, *, every: bool) -> None:
        """Draw the free run of an assessment; with `every`, also its prediction one step ahead."""
        self.replace("free_run", assessment.stamps, assessment.simulated)
        self.replace("free_error", assessment.stamps, assessment.error)
        if every:
            self.replace("predicted", assessment.stamps, assessment.predicted)
            self.replace("residual", assessment.stamps, assessment.innovation)

    def load(self, record: Record) -> None:
        """Hold one recording and nothing else."""
        with self._lock:
            self._begin_again()
            self.origin = record.start_ns
            self._rings["measured"].extend(record.absolute(record.time), record.output)
            self._rings["command"].extend(record.absolute(record.input_time), record.input[:, None])
            if record.reference is not None and record.reference_time is not None:
                self._rings["reference"].extend(record.absolute(record.reference_time), record.reference[:, :1])

    def _begin_again(self) -> None:
        """Forget the run before: its clock was another one."""
        for ring in self._rings.values():
            ring.clear()
        self.origin = None
        self.runs += 1
        self.version += 1

    def seconds(self, stamp: int) -> float:
        """Return a stamp on the page's axis: seconds since the first measurement."""
        return (stamp - (self.origin or 0)) / SECOND

    def stamp(self, seconds: float) -> int:
        """Return the stamp of an instant on the page's axis [ns]."""
        return (self.origin or 0) + round(seconds * SECOND)

    @property
    def span(self) -> tuple[float, float]:
        """Oldest and newest measurement that is kept [s]."""
        with self._lock:
            ring = self._rings["measured"]
            if ring.oldest is None or ring.newest is None:
                return 0.0, 0.0
            return self.seconds(ring.oldest), self.seconds(ring.newest)

    def view(
        self,
        start: float,
        stop: float,
        buckets: int,
        *,
        streams: Collection[str] = STREAMS,
        since: Mapping[str, float] | None = None,
    ) -> View:
        """Return what lies between two instants [s], at most some 2 * `buckets` points a stream.

        `streams`: that are wanted.
        `since`: newest sample of a stream that the reader has [s]: the buckets before that sample's are left out.
        """
        width = (stop - start) / max(buckets, 1)
        points: dict[str, tuple[Array, Array]] = {}
        newest: dict[str, float] = {}
        # One bucket more on either side, so that the lines reach the ends of the picture.
        first, last = self.stamp(start - width), self.stamp(stop + width)
        known = since or {}
        begins = {name: max(first, self.stamp(seconds - 2.0 * width)) for name, seconds in known.items()}
        with self._lock:
            end = self.newest
            raw = {
                name: self._rings[name].window(begins.get(name, first), last, before=name in SCALARS)
                for name in streams
            }
            # A browser that follows asks thirty times a second.
            asked = (self.version, first // SECOND, last // SECOND)
            if self._known_band is None or self._known_band[0] != asked:
                self._known_band = asked, self._band(first, last)
            band = self._known_band[1]
        for name, (stamps, values) in raw.items():
            seconds, old = (stamps - (self.origin or 0)) / SECOND, 0
            if len(seconds):
                newest[name] = float(seconds[-1])
            if name in known:
                # By the rule of the buckets themselves: one that is cut would lose its extremes.
                old = int(np.searchsorted(np.floor(seconds / width), np.floor(known[name] / width)))
                old = min(old, max(len(seconds) - 1, 0))
            few, kept = extremes(seconds[old:], values[old:], width)
            now = -np.inf if end is None else min(self.seconds(end), stop)
            # A command holds until now.
            if name == "command" and len(few) and now > few[-1]:
                few, kept = np.append(few, now), np.concatenate([kept, kept[-1:]])
            points[name] = few, kept
        return View(points, start, stop, newest, band)

    def _band(self, first: int, last: int) -> Array:
        """Three standard deviations of the sensor; of the residual's bulk where the model does not say, or is wrong."""
        band = BAND * self.noise
        residual = self._rings["residual"].window(first, last)[1]
        residual = residual[:: 1 + len(residual) // ENOUGH]
        for column in range(len(band)):
            known = residual[:, column][np.isfinite(residual[:, column])]
            if np.isfinite(band[column]):
                rms = float(np.sqrt(np.mean(known**2))) if len(known) >= FEWEST else np.inf
                # No reading is quieter than its noise.
                if 0.0 < rms < REFUTED * self.noise[column]:
                    band[column] = BAND * rms
            elif len(known) >= 20:
                band[column] = BAND * 1.4826 * float(np.median(np.abs(known - np.median(known))))
        return band

    def record(self, model: Model, start: int, stop: int) -> Record:
        """Return command and measurements between two stamps [ns] as a record of a model."""
        from idloop.records import Record

        with self._lock:
            command_stamps, command = self._rings["command"].window(start, stop, before=True)
            stamps, output = self._rings["measured"].window(start, stop)
        # Time is that of the page, so that a stretch found in the record is found on the page.
        origin = self.origin or 0
        return Record(
            name=f"{self.seconds(start):.1f} to {self.seconds(stop):.1f} s",
            input_time=(command_stamps - origin) / SECOND,
            input=command[:, 0],
            time=(stamps - origin) / SECOND,
            output=output,
            input_name=model.input.name,
            input_unit=model.input.unit,
            output_names=tuple(model.output_names),
            output_units=tuple(o.unit for o in model.outputs),
            start_ns=origin,
        )
