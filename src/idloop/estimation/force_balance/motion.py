"""Position, velocity and acceleration of every body from a record, band-limited.

Zero-phase differentiation as in inverse dynamics identification (Gautier, Janot and Vandanjon, IEEE Trans. Control
Systems Technology 21, 2013), with a cut-off from the data: from the excited band, or with the least error of velocity.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from idloop.estimation.observer.sensor_noise import noise_std
from idloop.estimation.sensors import body_sensors, lagging_sensors

if TYPE_CHECKING:
    from collections.abc import Sequence

    from idloop.estimation.dataset import Data
    from idloop.physics import Model
    from idloop.records import Record

Array = NDArray[np.float64]
_Pair = tuple[Array | None, Array | None]

# Cut-offs that are tried for the least error of the velocity.
_CUTOFFS = 40
# Share of the kinetic energy in the excited band.
_ENERGY_SHARE = 0.999
# Cut-off of the differentiating filter over the excited band, so that the filter does not distort it.
_FILTER_RATIO = 10.0
# Forces are compared in this lower part of the filter's band, where its gain is flat.
_COMPARISON_RATIO = 0.4
# Least cut-off, in lines of the spectrum.
_LEAST_LINES = 4.0
# Change of a velocity, in standard deviations of its noise, below which it counts as constant.
_FLAT = 1e-3
# Rest speed, as a multiple of the standard deviation of the velocity's noise.
_REST = 3.0
# Pauses of a sensor above so many steps are gaps.
_LONGEST_PAUSE = 5.0
# Samples over which a velocity is integrated for the comparison with the position.
_INTEGRATED = 10
# A velocity is late when it differs from the slope of the position by this part, and a delay explains so much of that.
_LATE, _BY_DELAY = 0.02, 0.75
# The two pairs of poles of the fourth-order Butterworth prototype: s² + q s + 1.
_DAMPING = (2.0 * np.sin(np.pi / 8.0), 2.0 * np.sin(3.0 * np.pi / 8.0))


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
        Share of measurement noise in the power of the acceleration.
    noise : array, shape (bodies, 3)
        Standard deviations of the measurement noise of position, velocity and acceleration in the comparison band.
    velocity_noise : array, shape (bodies,)
        Standard deviation of the measurement noise in `velocity`, up to the cut-off.
    cutoff : float
        Cut-off of the differentiating filter, the largest of all bodies [Hz].
    measured : tuple of pairs
        Readings of the position and velocity sensor of every body on the grid, in SI units; None without a sensor.
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
        """Samples of an index range."""
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

    def shifted(self, body: int, shift: float) -> Motion:
        """The same motion with the position of a body shifted [m or rad]."""
        position = self.position.copy()
        position[:, body] += shift
        return replace(self, position=position)

    @property
    def sample_time(self) -> float:
        """Grid step [s]."""
        return float(self.time[1] - self.time[0])

    @property
    def turned(self) -> Array:
        """Part of the sample time around each instant in which a velocity has the opposite sign, shape (n, bodies).

        Expected value, as the velocity changes linearly between the samples and has normal noise.
        """
        pairs = zip(np.ascontiguousarray(self.velocity.T), self.velocity_noise, strict=True)
        return np.column_stack([_turned(velocity, max(float(noise), 1e-300)) for velocity, noise in pairs])

    @property
    def rest_speed(self) -> Array:
        """Speed of every body below which it counts as at rest, shape (bodies,)."""
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
        Frequency [Hz] at which the gain of one pass is 0.71; values are unchanged at or above 0.45 / sample_time.
    sample_time : float
        [s].
    """
    if cutoff >= 0.45 / sample_time or len(values) < 40:
        return values
    pad = int(min(len(values) - 1, max(30.0, 3.0 / (cutoff * sample_time))))
    return zero_phase(values, cutoff, sample_time, pad)


def zero_phase(values: Array, cutoff: float, sample_time: float, pad: int) -> Array:
    """Fourth-order Butterworth filter forwards and backwards along the first axis of values (n,) or (n, k).

    The gain of one pass is 0.71 at the cut-off [Hz], below half the sample rate. The signal is extended at both ends by
    ``pad`` samples, fewer than n, by point reflection. Compiled: importing scipy.signal takes a second.
    """
    # Bilinear transform, prewarped to the cut-off.
    warped = np.tan(np.pi * cutoff * sample_time)
    sections = np.empty((len(_DAMPING), 3))
    for row, damping in enumerate(_DAMPING):
        scale = 1.0 + damping * warped + warped**2
        sections[row] = warped**2 / scale, 2.0 * (warped**2 - 1.0) / scale, (1.0 - damping * warped + warped**2) / scale
    before, after = 2.0 * values[0] - values[pad:0:-1], 2.0 * values[-1] - values[-2 : -pad - 2 : -1]
    extended = np.concatenate([before, values, after])
    columns = extended.reshape(len(extended), -1)
    _run(sections, columns)
    _run(sections, columns[::-1])
    return np.ascontiguousarray(extended[pad : pad + len(values)])


@njit(cache=True, nogil=True)
def _run(sections: Any, columns: Any) -> None:
    """Filter each column in place, from the stationary state of its first value."""
    for column in range(columns.shape[1]):
        for row in range(sections.shape[0]):
            b, a1, a2 = sections[row]
            # Numerator b (1 + z⁻¹)², unit gain at rest; direct form II transposed.
            first = (1.0 - b) * columns[0, column]
            second = (b - a2) * columns[0, column]
            for k in range(columns.shape[0]):
                value = columns[k, column]
                filtered = b * value + first
                first = 2.0 * b * value - a1 * filtered + second
                second = b * value - a2 * filtered
                columns[k, column] = filtered


def differentiate(values: Array, sample_time: float) -> Array:
    """Derivative along the first axis [1/s] by fourth-order central differences, of second order at the ends."""
    slope = np.gradient(values, sample_time, axis=0)
    inner = 8.0 * (values[3:-1] - values[1:-3]) - (values[4:] - values[:-4])
    slope[2:-2] = inner / (12.0 * sample_time)
    return np.asarray(slope)


def _spectrum(values: Array, segment: int, sample_time: float) -> tuple[Array, Array]:
    """Frequencies [Hz] and power by Welch's method, with overlap by half and without the mean of each segment."""
    window = _window(segment)
    pieces = np.lib.stride_tricks.sliding_window_view(values, segment)[:: segment - segment // 2]
    lines = np.fft.rfft((pieces - np.mean(pieces, axis=1, keepdims=True)) * window)
    power: Array = np.mean(np.abs(lines) ** 2, axis=0)
    power[1 : (segment + 1) // 2] *= 2.0
    return np.asarray(np.fft.rfftfreq(segment, sample_time), dtype=np.float64), power


def _window(segment: int) -> Array:
    """Periodic Hann window."""
    return np.asarray(0.5 * (1.0 - np.cos(2.0 * np.pi * np.arange(segment) / segment)))


def _segment(samples: int) -> int:
    """Samples in a segment of a spectrum: about a sixth of a record averages the noise and resolves slow motion."""
    return int(min(samples, max(256, 2 ** int(np.log2(max(samples / 6, 2))))))


def excitation_band(velocity: ArrayLike, sample_time: float) -> float:
    """Frequency [Hz] below which 99.9 % of the kinetic energy lies, after subtraction of the noise floor.

    Parameters
    ----------
    velocity : array, shape (n,)
        Measured velocity, or differenced position.
    sample_time : float
        [s].
    """
    v = np.asarray(velocity, dtype=float)
    frequency, power = _spectrum(v, _segment(len(v)), sample_time)
    upper = frequency > 0.8 * frequency[-1]
    shape = np.sin(np.pi * frequency * sample_time) ** 2
    # The spectrum of differenced position noise rises as sin², that of velocity noise is flat: take the better fit.
    rising = np.median(power[upper] / shape[upper]) * shape
    flat = np.full_like(power, np.median(power[upper]))
    misfit = [float(np.std(np.log(power[upper] / floor[upper] + 1e-300))) for floor in (rising, flat)]
    floor = rising if misfit[0] <= misfit[1] else flat
    signal = np.maximum(power - 2.0 * floor, 0.0)
    total = np.cumsum(signal)
    if total[-1] <= 0.0:
        return float(frequency[1])
    edge = frequency[min(int(np.searchsorted(total, _ENERGY_SHARE * total[-1])), len(total) - 1)]
    return float(max(edge, frequency[1]))


def _least_error_cutoff(place: Array | None, speed: Array | None, step: float) -> float:
    """Cut-off [Hz] at which the error of a filtered velocity is least: the motion it takes and the noise it passes.

    Both follow from the spectrum of the readings and the noise of the sensor (Stein, Annals of Statistics 9, 1981);
    that sensor counts whose error is less.
    """
    best = np.inf, 0.45 / step
    for order, values in enumerate((place, speed)):
        if values is None:
            continue
        raw = np.diff(values) / step if order == 0 else values
        segment = _segment(len(raw))
        frequency, power = _spectrum(raw, segment, step)
        power /= np.sum(_window(segment) ** 2)
        white = 2.0 * noise_std(values) ** 2
        differenced = (2.0 * np.sin(np.pi * frequency * step) / step) ** 2
        noise = white * (differenced if order == 0 else np.ones_like(frequency))
        motion = np.maximum(power - noise, 0.0)
        cutoffs = np.geomspace(_LEAST_LINES * frequency[1], 0.45 / step, _CUTOFFS)
        passed = 1.0 / (1.0 + (frequency / cutoffs[:, None]) ** 8)
        errors = passed**2 @ noise + (1.0 - passed) ** 2 @ motion
        least = int(np.argmin(errors))
        best = min(best, (float(errors[least]), float(cutoffs[least])))
    return best[1]


def uniform(time: Array, values: Array) -> tuple[Array, Array] | None:
    """Times and values on a uniform grid at the median rate, with gaps interpolated linearly.

    None when more than 5 % of the values (n,) are NaN, not measured: differentiation would invent motion.
    """
    known = np.isfinite(values)
    if np.mean(known) < 0.95 or np.sum(known) < 50:
        return None
    step = float(np.median(np.diff(time)))
    even = np.ptp(np.diff(time)) < 1e-3 * step
    grid = time if even else np.arange(time[0], time[-1] + 1e-6 * step, step)
    return grid, values if even and np.all(known) else np.interp(grid, time[known], values[known])


def measured_motion(model: Model, record: Data | Record, cutoff: float | None = None) -> Motion | None:
    """Motion of all bodies; None when a body is not measured.

    Parameters
    ----------
    model : Model
    record : Data or Record
        Jitter and short gaps are resampled. Of a body with both sensors a velocity that follows the position late, as
        that of a drive with a filter does, is not used.
    cutoff : float, optional
        Cut-off of the differentiating filter [Hz]; from the excited band when left out.
    """
    found = _readings(model, record)
    if found is None:
        return None
    grid, step, sensed = found
    if cutoff is None:
        cutoff = _FILTER_RATIO * max(excitation_band(_raw_velocity(*pair, step), step) for pair in sensed)
    return _filtered(grid, step, sensed, [cutoff] * len(sensed))


def _raw_velocity(place: Array | None, speed: Array | None, step: float) -> Array:
    """Unfiltered velocity of a body, of the position where no velocity is measured."""
    if speed is not None:
        return speed
    return np.diff(np.zeros(0) if place is None else place) / step


def least_error_motion(model: Model, record: Data | Record) -> Motion | None:
    """As `measured_motion`, with the cut-off of every body at which the error of its velocity is least."""
    found = _readings(model, record)
    if found is None:
        return None
    grid, step, sensed = found
    return _filtered(grid, step, sensed, [_least_error_cutoff(*pair, step) for pair in sensed])


def _readings(model: Model, record: Data | Record) -> tuple[Array, float, tuple[_Pair, ...]] | None:
    """Grid (n,), its step [s], and the readings of the position and velocity sensor of every body on it."""
    sensors = body_sensors(model)
    if any(pair == (None, None) for pair in sensors) or len(record.time) < 100:
        return None
    # A lagging sensor is used only where the body has no other.
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
    pairs = [
        (
            place,
            None if place is not None and speed is not None and _late(series[place], series[speed], step) else speed,
        )
        for place, speed in pairs
    ]
    return grid, step, tuple((None if i is None else series[i], None if j is None else series[j]) for i, j in pairs)


def _filtered(grid: Array, step: float, sensed: tuple[_Pair, ...], cutoffs: Sequence[float]) -> Motion:
    """Motion from the readings of every body, each with a cut-off [Hz] of its own."""
    cutoffs = [float(min(cutoff, 0.45 / step)) for cutoff in cutoffs]
    columns = [_body(*pair, cutoff, step) for pair, cutoff in zip(sensed, cutoffs, strict=True)]
    return Motion(
        time=grid,
        position=np.column_stack([c[0] for c in columns]),
        velocity=np.column_stack([c[1] for c in columns]),
        acceleration=np.column_stack([c[2] for c in columns]),
        noise_share=np.array([c[3] for c in columns]),
        noise=np.stack([c[4] for c in columns]),
        velocity_noise=np.array([c[5] for c in columns]),
        cutoff=max(cutoffs),
        measured=sensed,
    )


def _late(position: Array, velocity: Array, step: float) -> bool:
    """Whether a velocity is the slope of the position after a delay, as that of a drive with a filter is."""
    middle = 0.5 * (velocity[1:] + velocity[:-1])
    travelled = np.concatenate([[0.0], np.cumsum(middle)]) * step
    moved = position[_INTEGRATED:] - position[:-_INTEGRATED]
    apart = moved - (travelled[_INTEGRATED:] - travelled[:-_INTEGRATED])
    apart -= np.mean(apart)
    change = velocity[_INTEGRATED:] - velocity[:-_INTEGRATED]
    change = change - np.mean(change)
    size, power = float(np.mean(apart**2)), float(np.mean(change**2))
    if size <= _LATE**2 * float(np.mean(moved**2)) or power == 0.0:
        return False
    product = float(np.mean(apart * change))
    return product > 0.0 and product**2 >= _BY_DELAY * size * power


def _body(
    place: Array | None, speed: Array | None, cutoff: float, step: float
) -> tuple[Array, Array, Array, float, Array, float]:
    """Motion of one body from the sensor that gives the less noisy acceleration."""
    white = {order: noise_std(one) for order, one in enumerate((place, speed)) if one is not None}
    # The position is preferred when equal.
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


@njit(cache=True, nogil=True, error_model="numpy")
def _turned(velocity: Array, noise: float) -> Array:
    """As of `Motion.turned`, for one body."""
    found = np.zeros(len(velocity))
    for k in range(len(velocity)):
        here = -abs(velocity[k])
        for other in (velocity[max(k - 1, 0)], velocity[min(k + 1, len(velocity) - 1)]):
            # Halfway to the next sample, and with the sign that makes the velocity here negative.
            there = 0.5 * (here + (-other if velocity[k] >= 0.0 else other))
            low, high = min(here, there), max(here, there)
            if high - low > noise * _FLAT:
                found[k] += 0.5 * (_mean_above_zero(high, noise) - _mean_above_zero(low, noise)) / (high - low)
            else:
                found[k] += 0.25 * math.erfc(-0.5 * (low + high) / (math.sqrt(2.0) * noise))
    return found


@njit(cache=True, nogil=True, error_model="numpy")
def _mean_above_zero(value: float, noise: float) -> float:
    """Mean of the positive part of a value with normal noise."""
    ratio = value / (math.sqrt(2.0) * noise)
    return 0.5 * value * math.erfc(-ratio) + noise * math.exp(-(ratio**2)) / math.sqrt(2.0 * math.pi)


def _noise(order: int, white: float, band: float, step: float) -> Array:
    """Variance of a sensor's white noise in position, velocity and acceleration, up to a frequency [Hz].

    The one-sided density 2 σ² step passes as many derivatives as lie between the sensor (order 0: position, 1:
    velocity) and each of the three; zero for lower orders than the sensor's.
    """
    density = 2.0 * white**2 * step * band
    derivatives = [n - order for n in range(3)]
    return np.array([density * (2.0 * np.pi * band) ** (2 * n) / (2 * n + 1) if n >= 0 else 0.0 for n in derivatives])


def bridged(time: Array, model: Model, data: Data, margin: float) -> NDArray[np.bool_]:
    """Instants of ``time`` (n,) at which the motion is interpolated over a gap, or closer to one than a margin [s]."""
    inside = np.zeros(len(time), dtype=bool)
    for row in {row for pair in body_sensors(model) for row in pair if row is not None}:
        if uniform(data.time, data.output[:, row]) is None:  # too sparse to have been used
            continue
        known = data.time[np.isfinite(data.output[:, row])]
        for hole in np.flatnonzero(np.diff(known) > _LONGEST_PAUSE * data.sample_time):
            inside |= (time > known[hole] - margin) & (time < known[hole + 1] + margin)
    return inside
