"""Position, velocity and acceleration of every body from a record, band-limited.

Zero-phase differentiation as in inverse dynamics identification (Gautier,
Janot and Vandanjon, IEEE Trans. Control Systems Technology 21, 2013), with the
filter's cut-off taken from the data instead of from the user.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from idloop.estimation.force_balance.zero_phase import zero_phase
from idloop.estimation.observer.sensor_noise import noise_std
from idloop.estimation.sensors import body_sensors, lagging_sensors

if TYPE_CHECKING:
    from idloop.estimation.dataset import Data
    from idloop.physics import Model
    from idloop.records import Record

Array = NDArray[np.float64]

# The band that holds this share of the kinetic energy counts as excited ...
_ENERGY_SHARE = 0.999
# ... and the differentiating filter passes ten times as much, so that it distorts nothing in it.
_FILTER_RATIO = 10.0
# Forces are compared in the lower part of the filter's band, where it is flat.
_COMPARISON_RATIO = 0.4
# Slower than so many standard deviations of its noise, a velocity does not tell motion from standstill.
_REST = 3.0
# A sensor silent for longer than this many steps leaves a hole.
_LONGEST_BRIDGE = 5.0


@dataclass(frozen=True)
class Motion:
    """Band-limited motion of all bodies on a uniform grid.

    Attributes
    ----------
    time : array, shape (n,)
        Uniform instants [s].
    position, velocity, acceleration : array, shape (n, bodies)
        Motion in SI units.
    noise_share : array, shape (bodies,)
        Part of the acceleration's power that is measurement noise.
    noise : array, shape (bodies, 3)
        Standard deviations of the measurement noise of position, velocity and acceleration in the band in which
        forces are compared.
    velocity_noise : array, shape (bodies,)
        Standard deviation of what of the measurement noise is left in `velocity`, up to the cut-off.
    cutoff : float
        Cut-off of the differentiating filter [Hz].
    measured : tuple of pairs
        What the sensors of every body's position and velocity read on the grid, in SI units; None without a sensor.
    """

    time: Array
    position: Array
    velocity: Array
    acceleration: Array
    noise_share: Array
    noise: Array
    velocity_noise: Array
    cutoff: float
    measured: tuple[tuple[Array | None, Array | None], ...]

    def part(self, first: int, last: int) -> Motion:
        """From one sample up to another."""
        own = slice(first, last)
        measured = tuple((None if p is None else p[own], None if v is None else v[own]) for p, v in self.measured)
        return replace(
            self,
            time=self.time[own],
            position=self.position[own],
            velocity=self.velocity[own],
            acceleration=self.acceleration[own],
            measured=measured,
        )

    @property
    def sample_time(self) -> float:
        """Grid step [s]."""
        return float(self.time[1] - self.time[0])

    @property
    def rest_speed(self) -> Array:
        """Speed of every body below which it counts as standing, shape (bodies,)."""
        return _REST * self.velocity_noise

    @property
    def comparison_band(self) -> float:
        """Frequency up to which forces are compared [Hz]."""
        return _COMPARISON_RATIO * self.cutoff


def low_pass(values: Array, cutoff: float, sample_time: float) -> Array:
    """Zero-phase fourth-order Butterworth filter along the first axis.

    Parameters
    ----------
    values : array, shape (n,) or (n, k)
    cutoff : float
        Frequency [Hz] at which one pass is down to 0.71.
    sample_time : float
        Sample time [s].

    Returns
    -------
    array
        Filtered values; unchanged when the cut-off is at or above 0.45 / sample_time.
    """
    if cutoff >= 0.45 / sample_time or len(values) < 40:
        return values
    pad = int(min(len(values) - 1, max(30.0, 3.0 / (cutoff * sample_time))))
    return zero_phase(values, cutoff, sample_time, pad)


def differentiate(values: Array, sample_time: float) -> Array:
    """Central difference of fourth order along the first axis, second order at the ends.

    Parameters
    ----------
    values : array, shape (n,) or (n, k)
    sample_time : float
        Sample time [s].

    Returns
    -------
    array
        Derivative in units per second.
    """
    slope = np.gradient(values, sample_time, axis=0)
    inner = 8.0 * (values[3:-1] - values[1:-3]) - (values[4:] - values[:-4])
    slope[2:-2] = inner / (12.0 * sample_time)
    return np.asarray(slope)


def _spectrum(values: Array, segment: int, sample_time: float) -> tuple[Array, Array]:
    """Frequencies [Hz] from zero on, and power by Welch's method: halves overlap, each segment without its mean."""
    window = 0.5 * (1.0 - np.cos(2.0 * np.pi * np.arange(segment) / segment))
    pieces = np.lib.stride_tricks.sliding_window_view(values, segment)[:: segment - segment // 2]
    lines = np.fft.rfft((pieces - np.mean(pieces, axis=1, keepdims=True)) * window)
    power: Array = np.mean(np.abs(lines) ** 2, axis=0)
    power[1 : (segment + 1) // 2] *= 2.0
    return np.asarray(np.fft.rfftfreq(segment, sample_time), dtype=np.float64), power


def excitation_band(velocity: ArrayLike, sample_time: float) -> float:
    """Frequency below which 99.9 % of the kinetic energy lies.

    Parameters
    ----------
    velocity : array, shape (n,)
        Measured velocity, or differenced position.
    sample_time : float
        Sample time [s].

    Returns
    -------
    float
        Band edge [Hz], after the noise floor of the spectrum has been taken off.
    """
    v = np.asarray(velocity, dtype=float)
    # Segments of about a sixth of the record average the noise yet resolve slow motion.
    segment = int(min(len(v), max(256, 2 ** int(np.log2(max(len(v) / 6, 2))))))
    frequency, power = _spectrum(v, segment, sample_time)
    upper = frequency > 0.8 * frequency[-1]
    shape = np.sin(np.pi * frequency * sample_time) ** 2
    # Differenced position noise rises as sin², measured velocity noise is flat: take the better fit.
    rising = np.median(power[upper] / shape[upper]) * shape
    flat = np.full_like(power, np.median(power[upper]))
    spread = [float(np.std(np.log(power[upper] / floor[upper] + 1e-300))) for floor in (rising, flat)]
    floor = rising if spread[0] <= spread[1] else flat
    signal = np.maximum(power - 2.0 * floor, 0.0)
    total = np.cumsum(signal)
    if total[-1] <= 0.0:
        return float(frequency[1])
    edge = frequency[min(int(np.searchsorted(total, _ENERGY_SHARE * total[-1])), len(total) - 1)]
    return float(max(edge, frequency[1]))


def uniform(time: Array, values: Array) -> tuple[Array, Array] | None:
    """Values on a uniform grid at the median rate, gaps bridged by straight lines.

    Parameters
    ----------
    time : array, shape (n,)
    values : array, shape (n,)
        NaN where not measured.

    Returns
    -------
    (time, values) or None
        None when more than 5 % is missing: differentiation would invent motion.
    """
    known = np.isfinite(values)
    if np.mean(known) < 0.95 or np.sum(known) < 50:
        return None
    step = float(np.median(np.diff(time)))
    if np.ptp(np.diff(time)) < 1e-3 * step and np.all(known):
        return time, values
    grid = np.arange(time[0], time[-1] + 1e-6 * step, step)
    return grid, np.interp(grid, time[known], values[known])


def measured_motion(model: Model, record: Data | Record, cutoff: float | None = None) -> Motion | None:
    """Motion of all bodies, or None when a body is not measured.

    Parameters
    ----------
    model : Model
        Tells which output measures what.
    record : Data or Record
        Measured outputs; jitter and short gaps are resampled.
    cutoff : float, optional
        Cut-off of the differentiating filter [Hz]; from the data when left out.
    """
    sensors = body_sensors(model)
    if any(pair == (None, None) for pair in sensors) or len(record.time) < 100:
        return None
    # Where another sensor sees the body as well, one that lags is not asked.
    late = lagging_sensors(model)
    prompt = [tuple(None if row in late else row for row in pair) for pair in sensors]
    pairs = [best if any(row is not None for row in best) else pair for pair, best in zip(sensors, prompt, strict=True)]
    series: dict[int, Array] = {}
    grid = record.time
    for pair in pairs:
        for row in pair:
            if row is None:
                continue
            column = uniform(record.time, record.output[:, row])
            if column is not None:
                grid, series[row] = column[0], column[1] / model.outputs[row].scale
    pairs = [tuple(r if r in series else None for r in pair) for pair in pairs]
    if any(pair == (None, None) for pair in pairs):
        return None
    step = float(np.median(np.diff(grid)))
    if cutoff is None:
        bands = []
        for place, speed in pairs:
            v = series[speed] if speed is not None else np.diff(series[place]) / step  # type: ignore[index]
            bands.append(excitation_band(v, step))
        cutoff = _FILTER_RATIO * max(bands)
    cutoff = float(min(cutoff, 0.45 / step))
    sensed = tuple((None if i is None else series[i], None if j is None else series[j]) for i, j in pairs)
    columns = [_body(place, speed, cutoff, step) for place, speed in sensed]
    return Motion(
        time=grid,
        position=np.column_stack([c[0] for c in columns]),
        velocity=np.column_stack([c[1] for c in columns]),
        acceleration=np.column_stack([c[2] for c in columns]),
        noise_share=np.array([c[3] for c in columns]),
        noise=np.stack([c[4] for c in columns]),
        velocity_noise=np.array([c[5] for c in columns]),
        cutoff=cutoff,
        measured=sensed,
    )


def _body(
    place: Array | None, speed: Array | None, cutoff: float, step: float
) -> tuple[Array, Array, Array, float, Array, float]:
    """Motion of one body from whichever sensor gives the quieter acceleration."""
    white = {order: noise_std(one) for order, one in enumerate((place, speed)) if one is not None}
    # Of equals the position goes first.
    order = min(white, key=lambda k: float(_noise(k, white[k], cutoff, step)[2]))
    passed = _noise(order, white[order], cutoff, step)
    band, first = _COMPARISON_RATIO * cutoff, min(white)
    compared = _noise(first, white[first], band, step)
    compared[order:] = _noise(order, white[order], band, step)[order:]
    if place is not None and order == 0:
        position = low_pass(place, cutoff, step)
        velocity = differentiate(position, step)
    else:
        velocity = low_pass(np.zeros(0) if speed is None else speed, cutoff, step)
        middle = 0.5 * (velocity[1:] + velocity[:-1])
        travelled = np.concatenate([[0.0], np.cumsum(middle)]) * step
        position = travelled if place is None else low_pass(place, cutoff, step)
    acceleration = differentiate(velocity, step)
    power = float(np.var(acceleration))
    share = float(min(passed[2] / power, 1.0)) if power > 0 else 1.0
    return position, velocity, acceleration, share, np.sqrt(compared), float(np.sqrt(passed[1]))


def _noise(order: int, white: float, band: float, step: float) -> Array:
    """Variance that a sensor's white noise makes in position, velocity and acceleration up to a frequency [Hz].

    Its one-sided density is 2 σ² step, through as many derivatives as lie between the sensor (order 0 of a position,
    1 of a velocity) and each of the three; zero before the sensor's own.
    """
    density = 2.0 * white**2 * step * band
    derivatives = [n - order for n in range(3)]
    return np.array([density * (2.0 * np.pi * band) ** (2 * n) / (2 * n + 1) if n >= 0 else 0.0 for n in derivatives])


def bridged(time: Array, model: Model, data: Data, margin: float) -> NDArray[np.bool_]:
    """Instants at which the motion was bridged because a sensor was silent, and some time around.

    Parameters
    ----------
    time : array, shape (n,)
    model : Model
    data : Data
    margin : float
        How far a hole reaches to either side [s].

    Returns
    -------
    array of bool, shape (n,)
    """
    inside = np.zeros(len(time), dtype=bool)
    for row in {row for pair in body_sensors(model) for row in pair if row is not None}:
        if uniform(data.time, data.output[:, row]) is None:  # too sparse to have been used
            continue
        known = data.time[np.isfinite(data.output[:, row])]
        for hole in np.flatnonzero(np.diff(known) > _LONGEST_BRIDGE * data.sample_time):
            inside |= (time > known[hole] - margin) & (time < known[hole + 1] + margin)
    return inside
