"""Input, result and description of a kind of signal."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from idloop.arrays import Array, Integers
from idloop.errors import InputError
from idloop.parameter_table import ParameterSpec

# Most samples of a signal: 14 hours at 1 kHz, 400 MB; a request for more is a wrong unit.
LONGEST = 50_000_000
# An edge that falls on a sample up to rounding counts as on it: otherwise square waves would flicker.
CYCLE_TOLERANCE = 1e-9


@dataclass(frozen=True)
class Segment:
    """One stretch of a stepped signal, in sample indices."""

    start: int
    settled: int  # first sample after settling
    stop: int  # one past the last sample
    frequency: float = 0.0  # Hz; 0 where the stretch holds a constant level


@dataclass(frozen=True)
class LineGrid:
    """Harmonics of a multisine."""

    fundamental: float  # line spacing [Hz]
    excited: Integers  # harmonic numbers that carry power
    # Those left empty inside the band, where only odd or even nonlinearity (and noise) can show up
    odd_detection: Integers
    even_detection: Integers


@dataclass(frozen=True)
class Request:
    """Sampling grid and common parameters of a signal."""

    kind: str
    sample_time: float
    samples: int | None
    amplitude: float
    offset: float
    seed: int

    @property
    def rate(self) -> float:
        """Samples per second."""
        return 1.0 / self.sample_time

    @property
    def nyquist(self) -> float:
        """Half the sample rate in Hz."""
        return 0.5 / self.sample_time

    @property
    def length(self) -> int:
        """Number of samples; an error without a duration."""
        if self.samples is None:
            raise self.error("duration is missing; give the length in seconds")
        return self.samples

    def time(self) -> Array:
        """Sample times in seconds, starting at 0, shape (n,)."""
        return np.arange(self.length, dtype=np.float64) * self.sample_time

    def generator(self) -> np.random.Generator:
        """New random generator with the seed of the request."""
        return np.random.default_rng(self.seed)

    def to_samples(self, seconds: float) -> int:
        """Nearest whole number of samples."""
        return round(self.checked(seconds / self.sample_time))

    def checked(self, samples: float) -> float:
        """Return a number of samples; InputError where it is too large."""
        if samples > LONGEST:
            raise self.error(f"{samples:.3g} samples are too many (at most {LONGEST}); shorten its times")
        return samples

    def error(self, text: str) -> InputError:
        """Error that names this signal."""
        return InputError(f"signal {self.kind}: {text}")

    def check_frequency(self, name: str, frequency: float) -> float:
        """Refuse a frequency above half the sample rate."""
        if frequency > self.nyquist * (1.0 + CYCLE_TOLERANCE):
            raise self.error(
                f"{name} is {frequency:g} Hz, above half the sample rate ({self.nyquist:g} Hz); "
                "lower it or shorten sample_time"
            )
        return frequency

    def band(self, low: float, high: float | None, *, default_high: float | None = None) -> tuple[float, float]:
        """Check a band and fill in its upper edge (default: a tenth of the sample rate)."""
        if high is None:
            high = self.rate / 10.0 if default_high is None else default_high
        self.check_frequency("frequency_max", high)
        if low >= high:
            raise self.error(
                f"frequency_min ({low:g} Hz) is not below frequency_max ({high:g} Hz); lower the one or raise the other"
            )
        return low, high


@dataclass(frozen=True)
class Shape:
    """Result of a kind of signal."""

    value: Array  # shape (n,): shape to be scaled by the amplitude and shifted by the offset, unless `absolute`
    period_samples: int | None = None  # period where the samples repeat exactly
    segments: tuple[Segment, ...] = ()  # boundaries of the steps of a stepped signal
    lines: LineGrid | None = None  # harmonics of a multisine
    # Time derivative where the kind knows it in closed form (only for `absolute` shapes)
    rate: Array | None = None
    derived: Mapping[str, Any] = field(default_factory=dict)  # values chosen by the kind, such as the order of a PRBS
    notes: tuple[str, ...] = ()  # remarks for the user, one sentence each
    absolute: bool = False  # the values are final: scaled, shifted and starting from rest at zero


@dataclass(frozen=True)
class SignalKind:
    """A kind of excitation."""

    name: str  # name used everywhere
    description: str  # one sentence
    parameters: tuple[ParameterSpec, ...]  # the parameters of this kind alone
    generate: Callable[..., Shape]  # ``generate(request, **values) -> Shape``
    # ``peak`` (the signal stays within offset ± amplitude) or ``standard deviation``
    amplitude_means: Literal["peak", "standard deviation"] = "peak"
    natural_length: bool = False  # the kind can choose its own duration
