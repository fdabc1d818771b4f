"""An excitation signal with its spectrum and key figures."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from idloop.arrays import Array
from idloop.signals.base import LineGrid, Segment


@dataclass(frozen=True)
class Signal:
    """A sampled excitation.

    Parameters
    ----------
    name : str
        Kind of the signal.
    time : ndarray, shape (n,)
        Sample times in seconds, starting at 0.
    value : ndarray, shape (n,)
        Samples, in the unit of the amplitude; held from each time to the next.
    parameters : dict
        Every parameter, given or by default: ``build_signal(name, **parameters)`` repeats it.
    period_samples : int or None
        Period where the signal repeats exactly (the ramp-in apart).
    segments : tuple of Segment
        Boundaries of the steps of a stepped signal.
    lines : LineGrid or None
        Harmonics of a multisine.
    rate : ndarray, shape (n,), or None
        Time derivative per second where the kind knows it (smooth).
    derived : mapping
        Values chosen by the kind.
    notes : tuple of str
        Remarks for the user.
    """

    name: str
    time: Array
    value: Array
    parameters: dict[str, Any]
    period_samples: int | None
    segments: tuple[Segment, ...]
    lines: LineGrid | None
    rate: Array | None
    derived: Mapping[str, Any]
    notes: tuple[str, ...]

    @property
    def sample_time(self) -> float:
        """Seconds between samples."""
        return float(self.parameters["sample_time"])

    @property
    def duration(self) -> float:
        """Length in seconds, the last sample's hold included."""
        return self.value.size * self.sample_time

    @property
    def rms(self) -> float:
        """Root mean square about the offset."""
        return math.sqrt(float(np.mean((self.value - self.parameters["offset"]) ** 2)))

    @property
    def peak(self) -> float:
        """Largest distance from the offset."""
        return float(np.max(np.abs(self.value - self.parameters["offset"])))

    @property
    def crest_factor(self) -> float:
        """Peak over root mean square about the offset; 0 for a signal that never leaves it."""
        return self.peak / self.rms if self.rms > 0.0 else 0.0

    def spectrum(self) -> tuple[Array, Array]:
        """Amplitude spectrum, over whole periods where there are any.

        Returns
        -------
        frequency : ndarray, shape (m,)
            Hz, from 0 to half the sample rate.
        amplitude : ndarray, shape (m,)
            Peak amplitude of the sine at each frequency (the mean at 0): a sine of amplitude A that
            fits the record shows A at its line.
        """
        value = self._whole_periods()
        amplitude = np.abs(np.fft.rfft(value)) / value.size
        amplitude[1 : (value.size + 1) // 2] *= 2.0
        return np.fft.rfftfreq(value.size, self.sample_time).astype(np.float64), amplitude

    def power_band(self, share: float = 0.9) -> tuple[float, float]:
        """Band in Hz that holds the middle `share` of the power, the mean left out.

        Parameters
        ----------
        share : float
            Between 0 and 1.
        """
        frequency, amplitude = self.spectrum()
        power = np.cumsum(amplitude[1:] ** 2)
        # A constant leaves rounding errors behind, which are no band.
        if power.size == 0 or power[-1] <= 1e-24 * float(np.max(self.value**2)):
            return 0.0, 0.0
        edges = np.searchsorted(power / power[-1], [(1.0 - share) / 2.0, (1.0 + share) / 2.0])
        low, high = frequency[1:][np.minimum(edges, power.size - 1)]
        return float(low), float(high)

    def summary(self) -> dict[str, Any]:
        """Key figures as plain values, ready for JSON."""
        low, high = self.power_band()
        return {
            "kind": self.name,
            "samples": int(self.value.size),
            "sample_time": self.sample_time,
            "duration": self.duration,
            "minimum": float(np.min(self.value)),
            "maximum": float(np.max(self.value)),
            "rms": self.rms,
            "crest_factor": self.crest_factor,
            "band_hz": [low, high],
            "period_samples": self.period_samples,
            "derived": dict(self.derived),
            "notes": list(self.notes),
        }

    def _whole_periods(self) -> Array:
        period = self.period_samples
        if period is None or period > self.value.size:
            return self.value
        ramp = math.ceil(self.parameters["ramp_in"] / self.sample_time)
        periods = max((self.value.size - ramp) // period, 1)
        return self.value[self.value.size - periods * period :]
