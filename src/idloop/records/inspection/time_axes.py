"""The time axis of a command against that of the motion, by the motion itself.

The weak balance of forces is taken with the command at other times: shifted, and on a clock that runs faster or slower.
The acceleration follows the command best at the times at which it acted. All shifts at once are one correlation, by the
fast Fourier transform.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from idloop.arrays import Array
from idloop.records.inspection.axis import Axis
from idloop.records.inspection.response import Projection, dry

# Widths of the test functions [samples], and those for shifts alone, which cost little.
_WIDTHS, _PLAIN_WIDTHS = (17, 65), (9, 17, 33, 65, 129, 257, 513)
# Clocks that differ by more than this part are none; steps in which it is sought, and then around the best.
_FASTEST, _STEP, _FINE = 0.02, 5e-4, 5e-5
_FARTHEST, _PART = 1.0, 8  # shifts that are looked at: up to so many seconds, and this part of the record
_MOST_SHIFT, _SHIFT_PART = 256, 20  # ... and of shifts alone: up to so many samples
_FEWEST, _SIDE_BY_SIDE = 200, 13


@dataclass(frozen=True)
class TimeAxes:
    """How the times of a command would have to be changed for the motion to follow it best.

    A stamp ``t`` of the command becomes ``first + offset + stretch (t - first)``, with the first stamp of all.
    """

    # [s]; 1 where both clocks run alike
    offset: float
    stretch: float
    # Shares of the acceleration that the command explains: then, with the best shift alone, and as it is or acting
    # later by any time
    share: float
    without_stretch: float
    causal: float
    duration: float  # [s]


def time_axes(axis: Axis) -> TimeAxes | None:
    """Estimate the time axis of the command of an axis; None where there is too little to compare."""
    return max(_estimates(axis, _WIDTHS, stretched=True), key=lambda one: one.share, default=None)


def shifted_axes(axis: Axis) -> list[TimeAxes]:
    """Estimate how much earlier or later the command acted, over test functions of every width."""
    # As in the balances, some test functions side by side are needed.
    widths = [
        width for width in _PLAIN_WIDTHS if axis.grid is not None and axis.grid.time.size >= _SIDE_BY_SIDE * width
    ]
    return list(_estimates(axis, widths, stretched=False))


def _estimates(axis: Axis, widths: Sequence[int], *, stretched: bool) -> Iterator[TimeAxes]:
    """Estimates by each width; `stretched` is whether the clock of the command may run faster or slower."""
    grid = axis.grid
    if grid is None or not np.isfinite(grid.command).any():
        return
    source, order = (grid.position, 2) if np.isfinite(grid.position).any() else (grid.velocity, 1)
    for width in [one for one in widths if grid.time.size >= one + _FEWEST]:
        functions = Projection(width, grid.period)
        table = [_every(functions, grid.command), _every(functions, source, order)]
        table += [_every(functions, one) for one in (grid.speed, dry(grid))] + [np.ones(table[0].size)]
        if order == 2:
            place = _every(functions, source)
            table.append(place - np.nanmean(place))
        rows = np.column_stack(table)
        known = np.isfinite(rows).all(axis=1)
        command, acceleration, others = rows[known, 0], rows[known, 1], rows[known, 2:]
        if known.sum() < _FEWEST or np.std(command) == 0.0 or np.std(acceleration) == 0.0:
            continue
        # The first command stands before or behind the first sample of the motion.
        ahead = float(axis.input_time[0] - grid.time[np.flatnonzero(known)[0]])
        most = min(int(_FARTHEST / grid.period), command.size // _PART)
        most = most if stretched else min(_MOST_SHIFT, command.size // _SHIFT_PART)
        shifts = _Shifts(acceleration, others, most, 0 if stretched else most)
        yield _compare(command, shifts, grid.period, ahead, stretched=stretched)


def _compare(command: Array, shifts: _Shifts, period: float, ahead: float, *, stretched: bool) -> TimeAxes:
    rows = np.arange(command.size, dtype=np.float64)

    def at(faster: float) -> tuple[float, float, int]:
        shares = shifts.shares(np.interp(rows * (1.0 + faster), rows, command))
        place = int(np.argmax(shares))
        return float(shares[place]), faster, place - shifts.most

    plain = shifts.shares(command)
    share, faster, shift = at(0.0)
    if stretched:
        _, coarse, _ = max(at(one) for one in np.arange(-_FASTEST, _FASTEST + 0.5 * _STEP, _STEP))
        share, faster, shift = max(at(coarse + one) for one in np.arange(-_STEP, _STEP + 0.5 * _FINE, _FINE))
    stretch = 1.0 / (1.0 + faster)
    return TimeAxes(
        offset=shift * period + ahead * (stretch - 1.0),
        stretch=stretch,
        share=share,
        without_stretch=float(plain.max()),
        causal=float(plain[shifts.most :].max()),
        duration=command.size * period,
    )


class _Shifts:
    """The share of an acceleration that a command explains beside other signals, over all shifts [samples].

    `margin`: rows left out at both ends; with as many as the shifts, the command is known for all rows with each shift.
    """

    def __init__(self, acceleration: Array, others: Array, most: int, margin: int) -> None:
        self.most, self._margin = most, margin
        self._size = 1 << int(np.ceil(np.log2(acceleration.size + most + 1)))
        inside = slice(margin, acceleration.size - margin)
        basis = np.linalg.qr(others[inside])[0]
        left = acceleration[inside] - basis @ (basis.T @ acceleration[inside])
        self._rows, self._power = left.size, float(left @ left)
        self._spectra = np.conj(np.fft.rfft(np.column_stack([left, basis]), self._size, axis=0))

    def shares(self, command: Array) -> Array:
        """Shares (2 most + 1,) with the command from `most` samples earlier to as many later."""
        centred = command - command.mean()
        spectrum = np.fft.rfft(centred, self._size)
        products = np.fft.irfft(self._spectra * spectrum[:, None], self._size, axis=0)
        products = products[np.arange(self._margin + self.most, self._margin - self.most - 1, -1)]
        power = np.concatenate([[0.0], np.cumsum(centred**2)])
        power = (power[self._rows :] - power[: -self._rows])[::-1]
        alone = np.maximum(power - np.sum(products[:, 1:] ** 2, axis=1), 1e-6 * np.maximum(power, 1e-300))
        return np.asarray(products[:, 0] ** 2 / (alone * self._power))


def _every(functions: Projection, value: Array, derivative: int = 0) -> Array:
    """Mean of a derivative over a test function around every sample, shape (n - width + 1,)."""
    return np.asarray(np.convolve(value, functions.kernel(derivative)[::-1], mode="valid"))
