"""Records on an even grid: what the discrete-time (black-box) estimators read."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from idloop.arrays import Array, Mask
from idloop.errors import InputError
from idloop.records import Record

_EVEN = 0.05  # stamps within 5 % of a period are jitter of the clock, not another grid
_SIZES = (1e-60, 1e60)  # beyond these, products of squares are 0 or infinite
_SHORTEST = 20  # samples: a shorter stretch between two holes carries no dynamics


@dataclass(frozen=True, eq=False)
class SampledData:
    """One unbroken stretch of an experiment at a constant sample time.

    Raises InputError: shapes that do not belong together, or values that are not finite.
    """

    name: str  # record that it comes from
    input: Array  # shape (n, m): commands, constant from their sample to the next [`input_units`]
    output: Array  # shape (n, p): measurements at the samples [`output_units`], all known
    sample_time: float  # period [s]
    # Of the columns
    input_names: tuple[str, ...] = ("input",)
    input_units: tuple[str, ...] = ("-",)
    output_names: tuple[str, ...] = ("output",)
    output_units: tuple[str, ...] = ("-",)
    start: float = 0.0  # instant of the first sample on the record's time axis [s]
    # shape (n,): what the controller followed, the excitation included, in the unit of the position
    reference: Array | None = None
    reference_velocity: Array | None = None  # shape (n,): its velocity, where one was recorded
    feedforward: Array | None = None  # shape (n,): what the excitation added to the command [`input_units`]

    def __post_init__(self) -> None:
        for what, value, names in (("input", self.input, self.input_names), ("output", self.output, self.output_names)):
            if value.ndim != 2 or value.shape != (len(self), len(names)):
                raise InputError(
                    f"{self.name}: {what} of shape {value.shape}; it must be (samples, {what}s) ="
                    f" ({len(self)}, {len(names)})"
                )
            if not np.all(np.isfinite(value)):
                raise InputError(f"{self.name}: {what} holds NaN or infinite samples; cut them out first")
            size = float(max(np.max(value, initial=0.0), -np.min(value, initial=0.0)))  # no copy of a long record
            if size and not _SIZES[0] < size < _SIZES[1]:
                raise InputError(
                    f"{self.name}: {what} of size {size:.3g}, whose squares no number holds; give it another unit"
                )
        if not self.sample_time > 0:
            raise InputError(f"{self.name}: sample time {self.sample_time:g} s; it must be positive")

    def __len__(self) -> int:
        return int(self.output.shape[0])

    @property
    def time(self) -> Array:
        """Instants of the samples [s], shape (n,)."""
        return np.asarray(self.start + self.sample_time * np.arange(len(self)), dtype=float)

    @property
    def labels(self) -> dict[str, Any]:
        """Sample time, names and units, by the names that the result objects give them."""
        return {
            "sample_time": self.sample_time,
            "input_names": self.input_names,
            "input_units": self.input_units,
            "output_names": self.output_names,
            "output_units": self.output_units,
        }

    def part(self, first: int, last: int) -> SampledData:
        """Samples `first` to `last - 1`."""
        return replace(
            self,
            input=self.input[first:last],
            output=self.output[first:last],
            start=self.start + first * self.sample_time,
            reference=_part(self.reference, slice(first, last)),
            reference_velocity=_part(self.reference_velocity, slice(first, last)),
            feedforward=_part(self.feedforward, slice(first, last)),
        )

    def outputs(self, columns: Sequence[int]) -> SampledData:
        """Only some of the outputs."""
        return replace(
            self,
            output=self.output[:, list(columns)],
            output_names=tuple(self.output_names[c] for c in columns),
            output_units=tuple(self.output_units[c] for c in columns),
        )


def sampled(record: Record, sample_time: float | None = None, *, antialias: bool = True) -> list[SampledData]:
    """Put a record on an even grid; each hole in the measurements begins a new stretch.

    The command of a sample is its mean up to the next sample, which for a command held at the samples is the
    command itself. To a period of twice the recorded one or more both sides are filtered alike before, without
    phase and below 80 % of the new half sample rate, so that the model between them stays what it is.

    `sample_time`: period [s]; the record's own by default. `antialias`: filter before a coarser grid is taken. Returns:
    in the order of time. Raises InputError: nothing longer than 20 samples is left, or the period does not suit the
    record.
    """
    period = record.sample_time if sample_time is None else float(sample_time)
    source = record
    if antialias and period >= 2 * record.sample_time:
        source = record.filtered(None, 0.4 / period, inputs=True)
    steps = np.diff(source.time)
    measured = np.isfinite(source.output)
    # Sensors sampled in turn are interpolated; a row without any of them is a gap.
    rows = bool(np.all(measured.all(axis=1) == measured.any(axis=1)))
    even = bool(np.all(np.abs(steps - period) <= _EVEN * period))
    grid = source if even and rows else source.resample(period, antialias=False)
    command = np.append(grid.input_mean(grid.time), grid.input_at(grid.time[-1:]))
    command[~np.isfinite(grid.input_at(grid.time))] = np.nan
    known = np.all(np.isfinite(grid.output), axis=1) & np.isfinite(command)
    stretches = [stretch for stretch in _runs(known) if stretch.stop - stretch.start >= _SHORTEST]
    if not stretches:
        raise InputError(
            f"{record.name}: no stretch of {_SHORTEST} samples in which every output is measured;"
            " record for longer or leave out the output that is missing"
        )
    reference = held_sum(grid, grid.time, ("reference", 0), ("excitation", 0))
    velocity = held_sum(grid, grid.time, ("reference", 1))
    # A speed loop has no position reference.
    reference = velocity if reference is None else reference
    feedforward = held_sum(grid, grid.time, ("excitation", 1))
    return [
        SampledData(
            name=record.name,
            input=command[stretch, None],
            output=grid.output[stretch],
            sample_time=period,
            input_names=(record.input_name,),
            input_units=(record.input_unit,),
            output_names=record.output_names,
            output_units=record.output_units,
            start=float(grid.time[stretch.start]),
            reference=_part(reference, stretch),
            reference_velocity=_part(velocity, stretch),
            feedforward=_part(feedforward, stretch),
        )
        for stretch in stretches
    ]


def together(data: SampledData | Sequence[SampledData]) -> list[SampledData]:
    """Check that experiments can be identified together.

    Raises InputError: no data, or other signals or sample times than the first.
    """
    several = [data] if isinstance(data, SampledData) else list(data)
    if not several:
        raise InputError("no data to identify from; give at least one record")
    first = several[0]
    for other in several[1:]:
        if (other.input_names, other.output_names) != (first.input_names, first.output_names):
            raise InputError(
                f"{other.name}: signals {other.input_names + other.output_names} differ from those of {first.name}"
            )
        if abs(other.sample_time - first.sample_time) > 1e-3 * first.sample_time:
            raise InputError(
                f"{other.name}: sample time {other.sample_time:g} s, but {first.name} has {first.sample_time:g} s;"
                " resample them to one"
            )
    return several


def check_fits(data: SampledData, method: str, inputs: int, outputs: int, sample_time: float) -> None:
    """Check that a model's signals and sample time are those of the data."""
    if (data.input.shape[1], data.output.shape[1]) != (inputs, outputs):
        raise InputError(
            f"{data.name}: {data.input.shape[1]} inputs and {data.output.shape[1]} outputs; the model"
            f" {method} has {inputs} and {outputs}"
        )
    if abs(data.sample_time - sample_time) > 1e-3 * sample_time:
        raise InputError(
            f"{data.name}: sample time {data.sample_time:g} s, but the model {method} was identified at"
            f" {sample_time:g} s; resample the record"
        )


def _runs(known: Mask) -> list[slice]:
    edges = np.flatnonzero(np.diff(np.concatenate([[0], known.astype(np.int8), [0]])))
    return [slice(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _part(value: Array | None, stretch: slice) -> Array | None:
    return None if value is None else value[stretch]


def held_sum(record: Record, time: Array, *columns: tuple[str, int]) -> Array | None:
    """Sum of columns of the reference and the excitation at given times; None where none of them was recorded.

    `time` (n,): [s]; `columns`: ``("reference", 0)`` is the first column of `Record.reference`. Returns shape (n,).
    """
    from idloop.records.filtering import resample_held

    total: Array | None = None
    for name, column in columns:
        when, what = getattr(record, f"{name}_time"), getattr(record, name)
        if when is None or what is None or not np.any(np.isfinite(what[:, column])):
            continue
        # Before its first sample, and where it was not recorded, a signal adds nothing.
        held = np.nan_to_num(resample_held(when, what[:, column], time))
        total = held if total is None else total + held
    return total
