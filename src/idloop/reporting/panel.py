"""One record beside what models say about it, as every figure of a comparison draws it, and the frame of its values.

The measured range sets the scale, so that no stray of a free run spoils it: a free run may start absurdly (of a
velocity that hardly shows in quantised positions anything will do) or run away, and would press what was measured
into a line.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from idloop.arrays import Array
from idloop.reporting.residual_findings import believed_noise, refuted_noise
from idloop.validation.words import figure_text, fit_text

if TYPE_CHECKING:
    from idloop.records import Record
    from idloop.validation import Comparison

# A curve may leave the measured range by this many times its width before it is cut off.
_BEYOND, _RESIDUAL = 1.0, 2.0
# Residuals beyond this many times those of the best model are cut off.
_BESIDE = 8.0
# So few samples out there are strays: the rest of the curve sets its frame.
_FEW = 0.02
_ROOM = 0.06


@dataclass(frozen=True)
class Frame:
    """Range of one value axis."""

    low: float
    high: float
    # By the label of a curve that leaves the frame: how far it goes, in words
    strays: Mapping[str, str] = field(default_factory=dict)

    @property
    def cut(self) -> bool:
        """Whether a curve leaves the frame."""
        return bool(self.strays)


def value_frame(measured: Array, modelled: Mapping[str, Array]) -> Frame | None:
    """Frame of measured and modelled values.

    Returns: None where nothing was measured or it never changes: nothing sets a scale.
    """
    low, high = _reach(measured)
    span = high - low
    if not span > 0.0:
        return None
    least, most, strays = low, high, {}
    for label, values in modelled.items():
        known = values[np.isfinite(values)]
        if not len(known):
            continue
        out = (known < low - _BEYOND * span) | (known > high + _BEYOND * span)
        bottom, top = float(np.min(known)), float(np.max(known))
        if np.any(out):
            strays[label] = f"to {figure_text(bottom if low - bottom > top - high else top, 3)}"
            if np.mean(out) < _FEW:
                bottom, top = (float(value) for value in np.quantile(known, (0.5 * _FEW, 1.0 - 0.5 * _FEW)))
        least = min(least, max(bottom, low - _BEYOND * span))
        most = max(most, min(top, high + _BEYOND * span))
    room = _ROOM * (most - least)
    return Frame(least - room, most + room, strays)


def residual_frame(measured: Array, modelled: Mapping[str, Array], band: float | None = None) -> Frame | None:
    """Frame of measured less modelled values, with the band of the noise.

    `band`: its half width.
    Returns: None where nothing sets a scale.
    """
    low, high = _reach(measured)
    span = high - low
    if not span > 0.0:
        return None
    half = 0.0 if band is None or not np.isfinite(band) else band
    strays, ends, inner = {}, {}, {}
    for label, values in modelled.items():
        size = np.abs(measured - values)
        size = size[np.isfinite(size)]
        if not len(size):
            continue
        out, most = size > span, float(np.max(size))
        if np.any(out):
            few = float(np.mean(out)) < _FEW
            inside = 1.3 * float(np.quantile(size, 1.0 - _FEW)) if few else _RESIDUAL * span
            inner[label] = min(most, inside)
        ends[label] = most
    # What the best model leaves is to be seen beside what the others do, and the band of the noise with it.
    limit = _BESIDE * max(half, min((inner.get(label, most) for label, most in ends.items()), default=0.0))
    for label, most in ends.items():
        reach = min(inner.get(label, most), limit)
        if reach < most:
            strays[label] = f"to {figure_text(most, 3)}"
        half = max(half, reach)
    if not half > 0.0:
        return None
    return Frame(-(1.0 + _ROOM) * half, (1.0 + _ROOM) * half, strays)


def widest(frames: Iterable[Frame | None]) -> Frame | None:
    """One frame for axes that are linked; None where one of them has none, or none is cut off."""
    known = []
    for frame in frames:
        if frame is None:
            return None
        known.append(frame)
    if not any(frame.cut for frame in known):
        return None
    return Frame(min(frame.low for frame in known), max(frame.high for frame in known))


def _reach(values: Array) -> tuple[float, float]:
    known = values[np.isfinite(values)]
    return (float(np.min(known)), float(np.max(known))) if len(known) else (0.0, 0.0)


@dataclass(frozen=True)
class Panel:
    """One record and what the models say about it; a curve that leaves its frame says in the legend how far it goes."""

    title: str  # name of the record, and what it was used for
    record: Record  # names and units of its signals, its command
    time: Array  # shape (n,): instants of the outputs [s]
    output: Array  # shape (n, p): NaN where not measured
    modelled: Mapping[str, Array]  # shape (n, p): outputs of each model by its label
    # shape (p,): half width of the band in which the residual of a perfect model stays with 95 % probability
    band: Array | None = None
    notes: Mapping[str, Sequence[str]] = field(default_factory=dict)  # words for the legend by model and output

    def values(self, column: int) -> dict[str, Array]:
        """Modelled values of one output."""
        return {label: modelled[:, column] for label, modelled in self.modelled.items()}

    def half_band(self, column: int) -> float | None:
        """Half width of the band of one output; None where it is not known."""
        known = self.band is not None and np.isfinite(self.band[column])
        return float(self.band[column]) if known and self.band is not None else None

    def value_frame(self, column: int) -> Frame | None:
        """Frame of one output."""
        return value_frame(self.output[:, column], self.values(column))

    def residual_frame(self, column: int) -> Frame | None:
        """Frame of what is left of one output."""
        return residual_frame(self.output[:, column], self.values(column), self.half_band(column))

    def legend_entry(self, label: str, column: int) -> str:
        """A model's entry in the legend: its note, and how far it and its residual leave their frames."""
        note, frame, below = self.notes.get(label), self.value_frame(column), self.residual_frame(column)
        parts = [note[column]] if note else []
        if frame is not None and label in frame.strays:
            parts.append(f"leaves the frame, {frame.strays[label]}")
        elif below is not None and label in below.strays:
            parts.append(f"residual {below.strays[label]}")
        return f"{label} ({'; '.join(parts)})" if parts else label


def make_panel(title: str, rows: Sequence[tuple[str, Comparison]]) -> Panel:
    """Panel of the free run of each model on one record, by its label; without the band of a refuted noise."""
    first = rows[0][1]
    believed = believed_noise(first.model, refuted_noise(comparison for _, comparison in rows))
    noise = np.array([believed.get(output.name, np.nan) for output in first.model.outputs])
    notes = {label: [f"FIT {fit_text(one.fit[name], 3, ' %')}" for name in one.names] for label, one in rows}
    modelled = {label: one.simulated for label, one in rows}
    return Panel(title, first.record, first.time, first.measured, modelled, 1.96 * noise, notes)
