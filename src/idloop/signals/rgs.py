"""Random Gaussian signal, band-limited."""

from __future__ import annotations

import numpy as np

from idloop.parameter_table import ParameterSpec, positive
from idloop.signals.base import Request, Shape, SignalKind


def generate(request: Request, *, frequency_min: float, frequency_max: float | None) -> Shape:
    """Gaussian noise with no power outside the band, mean 0 and variance 1 exactly.

    The lines of the discrete Fourier transform inside the band get independent complex normal
    values, so every sample is Gaussian and the edges of the band are sharp; the signal is periodic
    in its own duration.
    """
    low, high = request.band(frequency_min, frequency_max, default_high=request.nyquist)
    count = request.length
    frequency = np.fft.rfftfreq(count, request.sample_time)
    edge = 1e-9 * high
    inside = (frequency >= low - edge) & (frequency <= high + edge)
    inside[0] = False
    if count % 2 == 0:
        inside[-1] = False
    if not inside.any():
        raise request.error(
            f"no frequency line of a {count * request.sample_time:g} s record lies between {low:g} "
            f"and {high:g} Hz; lengthen the duration or widen the band"
        )
    random = request.generator().standard_normal((2, int(inside.sum())))
    lines = np.zeros(frequency.size, dtype=np.complex128)
    lines[inside] = random[0] + 1j * random[1]
    value = np.fft.irfft(lines, count)
    value /= np.sqrt(np.mean(value**2))
    return Shape(value, period_samples=count, derived={"frequency_max": high})


KIND = SignalKind(
    "rgs",
    "Random Gaussian signal, band-limited; the amplitude is its standard deviation.",
    (
        ParameterSpec("frequency_min", "float", 0.0, "Lower edge of the band.", unit="Hz", minimum=0.0),
        positive("frequency_max", None, "Upper edge of the band; left out, half the sample rate.", "Hz"),
    ),
    generate,
    amplitude_means="standard deviation",
)
