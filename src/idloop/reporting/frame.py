"""The frame of a comparison: the measured range sets the scale, so that no stray of a free run spoils it.

A free run may start absurdly (of a velocity that hardly shows in quantised positions anything will do) or run away;
either would press what was measured into a line.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np

from idloop.arrays import Array
from idloop.validation.words import figure_text

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
