"""The linear part of a loop: frequency response, roots, and the band in which it acts."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from idloop.arrays import Array, Complex
from idloop.errors import InputError

# Frequencies per factor of ten, and around each resonance.
PER_DECADE, PER_RESONANCE = 200, 41
# Phase that a delay may turn from one frequency of the grid to the next [rad], and at most at the upper end.
DELAY_STEP, DELAY_MOST = 0.2, 60.0
PADE_ORDER = 6


@dataclass(frozen=True, eq=False)
class LinearPart:
    """Single-input single-output system with a delay."""

    system: Any  # as given
    space: Any  # the same as a state space
    delay: float = 0.0  # delay in series [s]

    @property
    def sample_time(self) -> float:
        """Seconds; 0 for a continuous system."""
        return float(self.system.dt or 0.0)

    @property
    def discrete(self) -> bool:
        """Whether the system is sampled."""
        return self.sample_time > 0.0

    @property
    def held_between(self) -> bool:
        """Whether the response to a jump begins without one and is known at every instant: relays switch exactly."""
        return not self.discrete and float(self.space.D[0, 0]) == 0.0

    def response(self, frequency: ArrayLike) -> Complex:
        """Frequency response at frequencies [Hz], shape (k,); infinite at a pole."""
        omega = 2.0 * math.pi * np.atleast_1d(np.asarray(frequency, dtype=float))
        point = np.exp(1j * omega * self.sample_time) if self.discrete else 1j * omega
        found = np.atleast_1d(self.system(point, warn_infinite=False)) * np.exp(-1j * omega * self.delay)
        return np.asarray(found, dtype=np.complex128)

    def slope(self, frequency: float) -> complex:
        """Derivative of the frequency response by the angular frequency, dG(jω)/dω."""
        step = 1e-5 * frequency
        low, high = self.response(np.array([frequency - step, frequency + step]))
        return complex((high - low) / (4.0 * math.pi * step))

    @property
    def rates(self) -> Complex:
        """Poles and zeros as roots in s [rad/s], shape (k,)."""
        roots = np.concatenate([self.system.poles(), self.system.zeros()]).astype(complex)
        return self._in_s(roots[np.isfinite(roots)])

    def _in_s(self, roots: Complex) -> Complex:
        if not self.discrete:
            return roots
        return np.asarray(np.log(roots[np.abs(roots) > 1e-12]) / self.sample_time, dtype=np.complex128)

    def grid(self, low: float | None = None, high: float | None = None) -> Array:
        """Frequencies [Hz] that show every bend of the response, by default two decades beyond all poles and zeros."""
        roots = self.rates
        sizes = np.abs(roots)[np.abs(roots) > 1e-6 * float(np.max(np.abs(roots), initial=0.0))]
        if self.delay > 0.0:
            sizes = np.append(sizes, 1.0 / self.delay)
        if self.discrete:
            sizes = np.append(sizes, 1.0 / self.sample_time)
        sizes = sizes if sizes.size else np.ones(1)
        bottom = 0.01 * sizes.min() / (2.0 * math.pi) if low is None else low
        top = 100.0 * sizes.max() / (2.0 * math.pi)
        if self.delay > 0.0:
            top = min(top, DELAY_MOST / self.delay / (2.0 * math.pi))
        if self.discrete:
            # At half the sample rate the response is always real.
            top = (0.5 - 1e-6) / self.sample_time
        top = top if high is None else high
        if not 0.0 < bottom < top or not math.isfinite(top):
            raise InputError(f"frequencies from {bottom:g} to {top:g} Hz: the band must be positive and not empty")
        parts = [np.geomspace(bottom, top, max(int(PER_DECADE * math.log10(top / bottom)), 50))]
        for root in roots[np.imag(roots) > 0.0]:
            width = max(abs(root.real), 1e-9 * abs(root)) * np.sinh(np.linspace(-4.0, 4.0, PER_RESONANCE))
            parts.append((root.imag + width) / (2.0 * math.pi))
        turning = self.delay + self.sample_time
        if turning > 0.0:
            parts.append(np.arange(bottom, top, DELAY_STEP / turning / (2.0 * math.pi)))
        every = np.unique(np.concatenate(parts))
        return every[(every >= bottom) & (every <= top)]

    def closed_roots(self, gain: complex) -> Complex:
        """Roots in s [rad/s] of 1 + gain · G for a constant complex gain; of a delay, an approximation."""
        late = self._with_delay()
        a, b, c, d = late.A, late.B, late.C, late.D
        return self._in_s(np.linalg.eigvals(a - gain / (1.0 + gain * d[0, 0]) * (b @ c)).astype(complex))

    def whole_delay(self) -> int:
        """Delay in samples of a sampled system; InputError where it is no whole number of them."""
        samples = round(self.delay / self.sample_time)
        if abs(samples * self.sample_time - self.delay) > 1e-6 * self.sample_time:
            raise InputError(
                f"delay {self.delay:g} s is no whole number of samples of {self.sample_time:g} s; put it in the system"
            )
        return samples

    def _with_delay(self) -> Any:
        if self.delay == 0.0:
            return self.space
        import control

        if self.discrete:
            samples = math.ceil(self.delay / self.sample_time - 1e-6)
            shift, last = np.eye(samples, k=-1), np.eye(1, samples, k=samples - 1)
            late = control.ss(shift, np.eye(samples, 1), last, 0.0, self.sample_time)
        else:
            late = control.ss(control.tf(*control.pade(self.delay, PADE_ORDER)))
        return control.series(late, self.space)


def linear_part(system: Any, delay: float = 0.0) -> LinearPart:
    """Read a python-control system of one input and one output; InputError for another or an improper one."""
    import control

    if not isinstance(system, control.TransferFunction | control.StateSpace):
        raise InputError(f"linear part: a python-control tf or ss is needed, not {type(system).__name__}")
    if system.ninputs != 1 or system.noutputs != 1:
        raise InputError(f"linear part: {system.ninputs} inputs and {system.noutputs} outputs; pick one of each")
    if system.dt is True:
        raise InputError("linear part: a sampled system of unknown sample time; give it dt in seconds")
    if not (math.isfinite(delay) and delay >= 0.0):
        raise InputError(f"linear part: the delay is {delay:g} s; it must be finite and not negative")
    try:
        space = control.ss(system)
    except (ValueError, control.exception.ControlNotImplemented) as error:
        raise InputError(f"linear part: {error}; more zeros than poles cannot be realised") from error
    return LinearPart(system, space, float(delay))
