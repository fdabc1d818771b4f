"""Pseudo-random binary sequence of maximum length."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from idloop.parameter_table import ParameterSpec, positive
from idloop.signals.base import Request, Shape, SignalKind

# Exponents of a primitive feedback polynomial for each register length; the tests prove each one.
TAPS: dict[int, tuple[int, ...]] = {
    2: (2, 1), 3: (3, 2), 4: (4, 3), 5: (5, 3), 6: (6, 5), 7: (7, 6), 8: (8, 6, 5, 4), 9: (9, 5), 10: (10, 7),
    11: (11, 9), 12: (12, 6, 4, 1), 13: (13, 4, 3, 1), 14: (14, 5, 3, 1), 15: (15, 14), 16: (16, 15, 13, 4),
    17: (17, 14), 18: (18, 11), 19: (19, 6, 2, 1), 20: (20, 17), 21: (21, 19), 22: (22, 21), 23: (23, 18),
    24: (24, 23, 22, 17), 25: (25, 22), 26: (26, 6, 2, 1), 27: (27, 5, 2, 1), 28: (28, 25), 29: (29, 27),
    30: (30, 6, 4, 1), 31: (31, 28),
}  # fmt: skip


def maximum_length_bits(order: int, count: int, start: int) -> NDArray[np.int8]:
    """Bits of a linear feedback shift register, zeros and ones, shape (count,).

    `order`: register length, 2 to 31; the bits repeat after ``2**order - 1``. `start`: register content at the start, 1
    to ``2**order - 1``.
    """
    from scipy.signal import max_len_seq

    state = (start >> np.arange(order)) & 1
    # scipy counts the taps from the other end of the register.
    bits, _ = max_len_seq(order, state, count, [order - tap for tap in TAPS[order][1:]])
    return np.asarray(bits)


def generate(
    request: Request, *, order: int | None, clock_divider: int | None, band_hz: float | None, inverse_repeat: bool
) -> Shape:
    """Two-level sequence, each bit held for `clock_divider` samples.

    As in MATLAB's `idinput`, a band of B Hz means bits held for rate / (2 B) samples: the power
    falls to about 40 % at B and to zero at 2 B.
    """
    divider = _divider(request, clock_divider, band_hz)
    turns = 2 if inverse_repeat else 1
    if order is None:
        order = _longest_order_within(request.length, divider * turns)
    period = (2**order - 1) * divider * turns
    samples = period if request.samples is None else request.samples
    start = int(request.generator().integers(1, 2**order))
    bits = maximum_length_bits(order, -(-samples // divider), start)
    levels = 2.0 * bits - 1.0
    if inverse_repeat:
        levels[1::2] *= -1.0
    notes: tuple[str, ...] = ()
    if samples < period:
        share, seconds = samples / period, period * request.sample_time
        note = f"the duration holds {share:.2g} of one period ({seconds:g} s)"
        notes = (f"{note}: the spectrum is not flat; lengthen it or lower the order",)
    derived = {"order": order, "clock_divider": divider, "band_hz": request.nyquist / divider}
    return Shape(np.repeat(levels, divider)[:samples], period_samples=period, derived=derived, notes=notes)


def _divider(request: Request, clock_divider: int | None, band_hz: float | None) -> int:
    if band_hz is None:
        return clock_divider or 1
    if clock_divider is not None:
        raise request.error("clock_divider and band_hz say the same thing; give only one of them")
    request.check_frequency("band_hz", band_hz)
    return max(round(request.nyquist / band_hz), 1)


def _longest_order_within(samples: int, samples_per_bit: int) -> int:
    fitting = [order for order in TAPS if (2**order - 1) * samples_per_bit <= samples]
    return max(fitting, default=min(TAPS))


KIND = SignalKind(
    "prbs",
    "Pseudo-random binary sequence of maximum length; two levels hide odd nonlinearities.",
    (
        ParameterSpec(
            "order",
            "int",
            None,
            "Length of the shift register; left out, the longest whose period fits the duration.",
            minimum=2,
            maximum=31,
        ),
        ParameterSpec("clock_divider", "int", None, "Samples for which each bit is held (1 when left out).", minimum=1),
        positive(
            "band_hz", None, "Upper edge of the band, in place of clock_divider; the nearest divider is taken.", "Hz"
        ),
        ParameterSpec(
            "inverse_repeat", "bool", False, "Invert every second bit: twice the period, odd harmonics only."
        ),
    ),
    generate,
    natural_length=True,
)
