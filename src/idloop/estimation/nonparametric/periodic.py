"""Records of a periodic excitation, period by period, as complex amplitudes of their lines."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from idloop.arrays import Array, Complex, Mask
from idloop.errors import InputError
from idloop.estimation.black_box.sampled import SampledData, together
from idloop.signals.base import LineGrid

_DIFFERENT = 0.25  # mismatch that a signal must have exceeded before it can repeat
_REPEATED = 0.2  # largest mismatch at which it repeats
_NEAR, _ALIKE = 1.3, 1e-4  # factor and offset up to which a mismatch counts as equal to the least
_MISSED = 1e-3  # mismatch that is accepted though another period fits better
_BETTER = 0.5  # largest mismatch of a better period, over that of the given one
_UNLIKE = 0.5  # mismatch of a signal that does not repeat at all
_NEAR_PART, _LEAST_NEAR = 100, 2  # neighbours of a period that are compared: its hundredth part, and at least so many
_CLOSER = 0.7  # largest mismatch of a better neighbour, over that of the given period: noise makes a smaller difference
_NEIGHBOURS = 21  # lines over which the noise of the driver is averaged
_ABOVE_NOISE = 15.0  # times the noise, power of an excited line: noise alone exceeds it once in a million lines
_EXCITED = 1e-4  # least power of an excited line, over that of the largest; less is noise or rounding


def mismatches(signal: Array) -> Array:
    """Power of what a shift by each lag changes, over twice the signal's own, shape (n // 2 + 1,).

    0 where the signal repeats, 1 on the average of what has nothing in common with itself.
    """
    from scipy.fft import irfft, next_fast_len, rfft

    centred = signal - np.mean(signal)
    count = len(centred)
    half = count // 2
    size = next_fast_len(2 * count, real=True)
    spectrum = rfft(centred, size)
    product = irfft(np.abs(spectrum) ** 2, size)[: half + 1]
    power = np.concatenate([[0.0], np.cumsum(centred**2)])
    lag = np.arange(half + 1)
    both = power[count - lag] + power[count] - power[lag]
    return np.asarray(np.clip(1.0 - 2.0 * product / np.maximum(both, 1e-300), 0.0, None))


def repetition(signal: Array) -> int | None:
    """Samples after which a signal repeats for the first time; None where it does not within half its length."""
    miss = mismatches(signal)
    away = np.flatnonzero(miss > _DIFFERENT)
    if away.size == 0:
        return None
    later = np.arange(len(miss)) >= away[0]
    least = float(np.min(miss[later]))
    if least > _REPEATED:
        return None
    return int(np.flatnonzero(later & (miss <= _NEAR * least + _ALIKE))[0])


def misfit(signal: Array, period: int) -> tuple[float, int | None] | None:
    """Mismatch of a claimed period and the one that fits; None where the claim is not worse than any other.

    A multiple of the period is a period.
    """
    miss = mismatches(signal)
    if period >= len(miss):
        return None
    here, found = float(miss[period]), repetition(signal)
    if here <= _MISSED or (found is not None and period % found == 0):
        return None
    # Noise hides what one sample changes in one period; over several periods the samples add up.
    closer = _closest(miss, period)
    if found is not None and float(miss[found]) <= _BETTER * here:
        as_good = closer != period and float(miss[closer]) <= _NEAR * float(miss[found]) + _ALIKE
        return here, closer if as_good else found
    if closer != period:
        return here, closer
    return (here, None) if found is None and here > _UNLIKE else None


def _closest(miss: Array, period: int) -> int:
    """The neighbour of a claimed period whose multiples fit clearly better, else the period."""
    width = min(max(period // _NEAR_PART, _LEAST_NEAR), period - 1)
    near = np.arange(period - width, period + width + 1)
    times = np.arange(1, max((len(miss) - 1) // near[-1], 1) + 1)
    lags = np.minimum(near[:, None] * times, len(miss) - 1)
    mismatch = np.mean(miss[lags], axis=1)
    best = int(np.argmin(mismatch))
    return int(near[best]) if mismatch[best] < _CLOSER * mismatch[width] else period


@dataclass(frozen=True, eq=False)
class PeriodicSpectra:
    """Complex peak amplitudes of the lines of all experiments."""

    data: tuple[SampledData, ...]
    frequency: Array  # shape (k,): lines above zero and below half the sample rate [Hz]
    output: tuple[Complex, ...]  # shape (periods, k, p): for each experiment and period
    input: tuple[Complex, ...]  # shape (periods, k)
    driver: Complex  # shape (experiments, k): free of the plant's noise: the reference, or the input of an open loop
    excited: Mask  # shape (experiments, k): where the driver carries power

    @property
    def periods(self) -> int:
        """Of the experiment that has fewest."""
        return min(len(one) for one in self.output)

    @property
    def samples(self) -> int:
        """Samples of all the periods."""
        return sum(len(one) for one in self.data)


def by_period(
    data: SampledData | Sequence[SampledData],
    period: int,
    *,
    lines: LineGrid | Sequence[LineGrid] | None = None,
    skip: int = 1,
    by_reference: bool = False,
    drift: bool = True,
) -> PeriodicSpectra:
    """Cut records into periods and transform each of them.

    `data`: one input; each experiment is a realisation of the excitation; `period`: [samples]; `lines`: what was
    excited; read off the driver's spectrum by default; `skip`: periods at the start that are left to the transient;
    `by_reference`: whether the reference drives the experiment (closed loop) or the input (open loop); `drift`: take
    off the straight line by which each signal moves from period to period, as the position of an axis without a stop
    does; it would leak into every line. Raises InputError: fewer than two periods, more than one input, no reference
    where one is needed, or a driver that does not repeat with the period.
    """
    several = together(data)
    first = several[0]
    if first.input.shape[1] != 1:
        raise InputError(f"{first.name}: {first.input.shape[1]} inputs; one multisine gives the response to one input")
    period = int(period)
    if period < 4 or skip < 0:
        raise InputError(f"{first.name}: period of {period} samples, {skip} skipped; take at least 4 and skip none")
    outputs, inputs, drivers, noises = [], [], [], []
    for one in several:
        count = len(one) // period - skip
        if count < 2:
            raise InputError(
                f"{one.name}: {len(one)} samples hold {max(count, 0)} periods of {period} after {skip} for the"
                " transient; two or more are needed to separate noise and distortion"
            )
        if by_reference and one.reference is None:
            raise InputError(f"{one.name}: no reference recorded; without it only an open loop can be measured")
        signals = [one.output, one.input]
        if by_reference and one.reference is not None:
            signals.append(one.reference[:, None])
        values = np.hstack(signals)[len(one) - count * period :].reshape(count, period, -1)
        if lines is None:
            _check_repetition(one, values[:, :, -1], period)
        if drift:
            values = _without_drift(values)
        amplitude = 2.0 / period * np.fft.rfft(values, axis=1)[:, 1 : (period + 1) // 2]
        p = one.output.shape[1]
        outputs.append(amplitude[:, :, :p])
        inputs.append(amplitude[:, :, p])
        drivers.append(np.mean(amplitude[:, :, -1], axis=0))
        noises.append(_noise_floor(amplitude[:, :, -1]))
    driver = np.array(drivers)
    frequency = np.arange(1, driver.shape[1] + 1) / (period * first.sample_time)
    excited = _excited(driver, np.array(noises), lines, first, period)
    return PeriodicSpectra(tuple(several), frequency, tuple(outputs), tuple(inputs), driver, excited)


def _check_repetition(one: SampledData, driver: Array, period: int) -> None:
    """Refuse a period with which what drives the experiment, shape (periods, period), does not repeat."""
    found = misfit(driver.ravel(), period)
    if found is None:
        return
    mismatch, own = found
    advice = (
        "it does not repeat with any: record a periodic excitation, as a multisine"
        if own is None
        else f"it repeats after {own} samples: give a period of {own * one.sample_time:.6g} s"
    )
    raise InputError(
        f"{one.name}: the excitation does not repeat after {period} samples ({period * one.sample_time:.6g} s),"
        f" {100.0 * min(mismatch, 1.0):.0f} % of its power differs; {advice}"
    )


def _without_drift(values: Array) -> Array:
    """Periods without the ramp that leads from the mean of the first to that of the last, shape (P, period, c)."""
    count, period, _ = values.shape
    means = np.mean(values, axis=1)
    slope = (means[-1] - means[0]) / ((count - 1) * period)
    instant = np.arange(count * period, dtype=float).reshape(count, period, 1)
    return np.asarray(values - slope * instant)


def _noise_floor(periods: Complex) -> Array:
    """Power that noise leaves of the mean over the periods, shape (P, k), over each line and its neighbours, (k,)."""
    count = len(periods)
    scatter = np.sum(np.abs(periods - np.mean(periods, axis=0)) ** 2, axis=0) / (count - 1) / count
    width = min(_NEIGHBOURS, scatter.size)
    kernel = np.ones(width)
    return np.asarray(np.convolve(scatter, kernel, "same") / np.convolve(np.ones(scatter.size), kernel, "same"))


def _excited(
    driver: Complex, noise: Array, lines: LineGrid | Sequence[LineGrid] | None, first: SampledData, period: int
) -> Mask:
    """Lines that were meant to be excited in each experiment, shape (experiments, k)."""
    if lines is None:
        power = np.abs(driver) ** 2
        greatest = np.max(power, axis=1, keepdims=True)
        if not np.all(greatest > 0):
            raise InputError(f"{first.name}: what should excite the plant does not move; record a multisine")
        return np.asarray((power > _EXCITED * greatest) & (power > _ABOVE_NOISE * noise))
    grids = [lines] * len(driver) if isinstance(lines, LineGrid) else list(lines)
    if len(grids) != len(driver):
        raise InputError(f"{len(grids)} line grids for {len(driver)} experiments; give one, or one for each")
    excited = np.zeros(driver.shape, dtype=bool)
    for row, grid in zip(excited, grids, strict=True):
        spacing = grid.fundamental * period * first.sample_time
        if abs(spacing - 1.0) > 1e-3 or np.max(grid.excited) > row.size:
            raise InputError(
                f"{first.name}: lines {grid.fundamental:g} Hz apart do not belong to a period of {period} samples at"
                f" {first.sample_time:g} s; give the excitation's own period"
            )
        row[grid.excited - 1] = True
    return excited
