"""Frequency responses of measurement and model by one estimator from one command, and poles of the linear part."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from idloop.arrays import Array, Complex, Mask
from idloop.errors import IdloopError
from idloop.validation.words import percent, short

if TYPE_CHECKING:
    from idloop.estimation.nonparametric import FrequencyResponse
    from idloop.validation import Comparison


# Part of the largest pole below which a pole, or its imaginary part, is the rounding error of an eigenvalue solver.
_ROUNDING = 1e-9
# Coherence from which on a response is read: below it more than two fifths of the output are not the command's.
READABLE = 0.6


@dataclass(frozen=True, eq=False)
class BodeLine:
    """A response of one output as it is drawn, over all lines from the resolution upwards."""

    magnitude: Array  # shape (f,): at every line
    readable: Mask  # shape (f,): where the command explains the output
    phase: Array  # shape (f,): [deg]; NaN where it is not readable: what is unwrapped there is noise

    @property
    def read(self) -> Array:
        """Magnitude where it is readable; NaN elsewhere."""
        return np.where(self.readable, self.magnitude, np.nan)

    @property
    def unread(self) -> Array:
        """Magnitude elsewhere, with the lines beside so that no gap is drawn; NaN where it is readable."""
        inside = self.readable & np.roll(self.readable, 1) & np.roll(self.readable, -1)
        return np.where(inside, np.nan, self.magnitude)


@dataclass(frozen=True, eq=False)
class FrequencyView:
    """A model beside a record over frequency."""

    # Of the measured outputs and of the free run, at the same lines
    measured: FrequencyResponse
    model: FrequencyResponse
    poles: Complex  # of the linear part of the model [1/s]

    @property
    def frequency(self) -> Array:
        """Lines that are drawn [Hz]."""
        return self.measured.frequency[self.measured.resolved]

    def coherence(self, output: int) -> Array | None:
        """Share of the power of an output that the command explains."""
        known = self.measured.coherence
        return None if known is None else np.asarray(known[self.measured.resolved, output])

    def bode(self, output: int) -> tuple[BodeLine, BodeLine]:
        """Responses of measurement and model; the measured phase lies within half a turn of the model's."""
        kept = self.measured.resolved
        found, modelled = (one.response[kept, output, 0] for one in (self.measured, self.model))
        seen, runs = (_readable(one, output) for one in (self.measured, self.model))
        angle = _unwrapped(modelled, seen | runs)
        near = angle + np.angle(found * np.conj(modelled))
        return (
            BodeLine(np.abs(found), seen, np.where(seen, np.degrees(near), np.nan)),
            BodeLine(np.abs(modelled), runs, np.where(runs, np.degrees(angle), np.nan)),
        )

    def frequency_note(self, output: int) -> str:
        """Over which frequencies the response can be read, in words."""
        seen = self.frequency[_readable(self.measured, output)]
        if not len(seen):
            return f"The coherence is nowhere above {READABLE:g}: this record does not show the response."
        share, ends = percent(len(seen) / len(self.frequency)), " and ".join(short(float(seen[i])) for i in (0, -1))
        where = f"at {share} of the frequencies, between {ends} Hz"
        return f"It can be read where the coherence is above {READABLE:g}: {where}."

    @property
    def pole_texts(self) -> list[str]:
        """Each real pole by its value, each pair by its natural frequency and damping ratio, slow ones first."""
        texts = []
        # What an eigenvalue solver leaves of zero.
        nothing = _ROUNDING * float(np.max(np.abs(self.poles), initial=0.0))
        for pole in sorted(self.poles, key=abs):
            size = float(abs(pole))
            if abs(pole.imag) <= _ROUNDING * size:
                texts.append("0 (integrator)" if size <= nothing else f"{short(pole.real)} 1/s")
            elif pole.imag > 0.0:
                texts.append(f"{short(size / (2 * np.pi))} Hz, damping ratio {short(-pole.real / size)}")
        return texts


def _readable(one: FrequencyResponse, output: int) -> Mask:
    """Lines of a response, from the resolution upwards, at which the command explains the output."""
    if one.coherence is None:
        return np.ones(int(np.count_nonzero(one.resolved)), dtype=bool)
    return np.asarray(one.coherence[one.resolved, output] >= READABLE)


def _unwrapped(response: Complex, readable: Mask) -> Array:
    """Angle without jumps within every band of readable lines [rad]; each begins within half a turn of the last one."""
    angle, last_angle = np.angle(response), 0.0
    edges = np.flatnonzero(np.diff(np.concatenate([[False], readable, [False]]).astype(int)))
    for first, last in zip(edges[::2], edges[1::2], strict=True):
        band = np.unwrap(angle[first:last])
        angle[first:last] = band - 2.0 * np.pi * np.round((band[0] - last_angle) / (2.0 * np.pi))
        last_angle = float(angle[last - 1])
    return np.asarray(angle)


def frequency_view(comparison: Comparison) -> FrequencyView | None:
    """Estimate both responses by Welch's method; None where the record or the free run allows none.

    The free run goes through the same estimator, so that leakage and nonlinear effects show in both alike.
    """
    from idloop.estimation.black_box.sampled import sampled
    from idloop.estimation.nonparametric import welch
    from idloop.physics.engine import Engine

    record = comparison.record
    try:
        measured, model = (welch(sampled(one)) for one in (record, replace(record, output=comparison.simulated)))
    except IdloopError:
        return None
    if not np.array_equal(measured.frequency, model.frequency):
        return None
    poles = np.linalg.eigvals(Engine(comparison.model).linearise().A).astype(complex)
    return FrequencyView(measured, model, poles)
