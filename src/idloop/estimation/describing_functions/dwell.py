"""The steps of a stepped-sine experiment: where one sine runs at one amplitude and frequency."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from idloop.arrays import Array
from idloop.errors import InputError
from idloop.estimation.describing_functions.sine_fit import refine_frequency
from idloop.records import Record
from idloop.signals import Signal
from idloop.spelling import did_you_mean_or_known

# A crossing counts once the signal has left this part of its range.
_HYSTERESIS = 0.005
# Periods and amplitudes that differ by less than this part belong to one step.
_ALIKE = 0.03


@dataclass(frozen=True, eq=False)
class RecordedSignal:
    """Stamps and values of one signal, what was not measured left out."""

    name: str
    unit: str  # empty for a reference or excitation, of which none is recorded
    time: Array  # shape (n,): stamps [s]
    value: Array  # shape (n,)
    held: bool  # held from each stamp to the next (command, reference, excitation), or sampled (outputs)


def recorded_signal(record: Record, name: str) -> RecordedSignal:
    """Find a signal: the command, an output, or a column of the reference or the excitation.

    `name`: ``record.input_name``, one of ``record.output_names``, ``reference.position``, ``reference.velocity``,
    ``excitation.position`` or ``excitation.effort``.
    """
    known: dict[str, tuple[Array, Array, str, bool]] = {
        record.input_name: (record.input_time, record.input, record.input_unit, True)
    }
    for column, output in enumerate(record.output_names):
        known[output] = (record.time, record.output[:, column], record.output_units[column], False)
    for kind, fields in (("reference", ("position", "velocity")), ("excitation", ("position", "effort"))):
        when, what = getattr(record, f"{kind}_time"), getattr(record, kind)
        if when is not None and what is not None:
            for column, field in enumerate(fields):
                known[f"{kind}.{field}"] = (when, what[:, column], "", True)
    if name not in known:
        raise InputError(f"{record.name}: no signal {name!r}{did_you_mean_or_known(name, known)}")
    time, value, unit, held = known[name]
    there = np.isfinite(value)
    if there.sum() < 2:
        raise InputError(f"{record.name}: {name} was not measured; choose another signal")
    return RecordedSignal(name, unit, time[there], value[there], held)


@dataclass(frozen=True)
class Dwell:
    """One settled stretch of a sine."""

    # After settling, to the end of the last whole period [s on the record's axis]
    start: float
    stop: float
    frequency: float  # Hz

    @property
    def periods(self) -> float:
        """Periods in the stretch."""
        return (self.stop - self.start) * self.frequency


def dwells_of(signal: Signal, start: float = 0.0) -> tuple[Dwell, ...]:
    """Steps of an excitation that was built, settling left out.

    `signal`: from ``build_signal("stepped_sine", ...)``; `start`: when its first sample was sent [s on the record's
    axis]. Raises InputError: the signal has no steps with a frequency.
    """
    step = signal.sample_time
    found = tuple(
        Dwell(start + segment.settled * step, start + segment.stop * step, segment.frequency)
        for segment in signal.segments
        if segment.frequency > 0.0
    )
    if not found:
        raise InputError(f"signal {signal.name}: no steps of a sine; build a stepped_sine")
    return found


def find_dwells(record: Record, source: str | None = None, settle_periods: int = 2) -> tuple[Dwell, ...]:
    """Steps of a stepped sine, found in the recorded command (or another signal without much noise).

    `record`: the experiment; `source`: signal to search; the command by default; `settle_periods`: periods left out at
    the beginning of each step. Returns: steps with at least two periods after settling. Raises InputError: no such
    signal, or no step of a sine in it.
    """
    signal = recorded_signal(record, record.input_name if source is None else source)
    time, value = signal.time, signal.value
    crossing = _upward_crossings(time, value)
    if crossing.size < 2:
        raise InputError(f"{record.name}: {signal.name} does not oscillate; name the signal that the sine was sent by")
    period = np.diff(crossing)
    edges = np.searchsorted(time, crossing)
    swing = np.array([np.ptp(value[a:b]) if b > a else 0.0 for a, b in itertools.pairwise(edges)])
    step = float(np.median(np.diff(time)))
    dwells, first = [], 0
    for k in range(1, period.size + 1):
        # A crossing between two samples is known to about one of them.
        if k < period.size and _alike(period[first], period[k], 1.5 * step) and _alike(swing[first], swing[k], 0.0):
            continue
        if k - first >= settle_periods + 2:
            inside = (time >= crossing[first]) & (time < crossing[k])
            guess = (k - first) / (crossing[k] - crossing[first])
            frequency = refine_frequency(time[inside], value[inside], float(guess))
            dwells.append(Dwell(float(crossing[first]) + settle_periods / frequency, float(crossing[k]), frequency))
        first = k
    if not dwells:
        raise InputError(
            f"{record.name}: no {settle_periods + 2} equal periods in a row in {signal.name}; "
            "dwell longer at each step, or give the dwells"
        )
    return tuple(dwells)


def _alike(a: float, b: float, floor: float) -> bool:
    return abs(b - a) <= max(_ALIKE * abs(a), floor)


def _upward_crossings(time: Array, value: Array) -> Array:
    """Instants at which the signal rises through its middle [s], small wiggles left out."""
    middle = value - 0.5 * (float(np.max(value)) + float(np.min(value)))
    band = _HYSTERESIS * float(np.ptp(value))
    side = np.where(middle > band, 1, np.where(middle < -band, -1, 0))
    clear = np.flatnonzero(side)
    turns = clear[1:][(side[clear[1:]] > 0) & (side[clear[:-1]] < 0)]
    found = []
    for k in turns:
        below = int(np.flatnonzero(middle[:k] <= 0.0)[-1])
        rise = middle[below + 1] - middle[below]
        found.append(time[below] - middle[below] * (time[below + 1] - time[below]) / rise)
    return np.array(found, dtype=np.float64)
