"""Velocities that a driver computed from the position, which add no information to it.

Hobby servos, state publishers and many drives have no tachometer: their velocity is the difference of the last
positions, often behind a low-pass filter or a tracking loop. Its noise is then a function of the noise of the position,
and an observer must not treat the two as independent sensors.

Such a velocity obeys ``v[k] = Σ a_i v[k - i] + Σ b_j d[k - j]`` with the differences ``d`` of the recorded position. A
separate sensor does not, whatever its filter: its error against that sum contains the noise of the position as the sum
transmits it. So the sum counts as exact where it leaves only a small part of that noise. Where the position shows no
noise there is no decision, because a few sines, or a simulation without noise, obey many sums. Noise is the part that
neither a high-order difference of the position removes nor its own past predicts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from weakref import finalize

import numpy as np

from idloop.arrays import Array, Integers, Mask
from idloop.records.finding import Finding
from idloop.records.record import Record

KIND = "differenced_velocity"

# Samples in motion needed; samples of a first quick test; most samples that are used.
_FEWEST, _QUICK, _MOST = 150, 1200, 5000
_ROUNDING = 0.25  # share of the transmitted noise that an exact sum may leave, due to rounding
_ODD = 0.02  # share of outliers, after a lost message or a wrap of the encoder
_JERKS = 0.2  # jerks of the motion are not noise: this share of its largest differences is left out
_ORDERS = range(1, 9)  # orders of difference, of which the one with the least motion estimates the noise
_PAST = 24  # past differences that predict the next one: exactly for half as many sines
_LEAST_NOISE = 1e-9  # noise below this share of the differences is rounding
_MEMORY = 500  # longest impulse response of a filter [samples]
_WIDEST = 10  # widest window of a plain difference
# Filters of drives behind the difference of the last sample: number of poles, and weights of the last differences.
# A first-order low pass, plain, one sample late or by the bilinear rule; a second-order one or a tracking loop.
_FILTERS = ((1, (1,)), (1, (0, 1)), (1, (1, 1)), (2, (1,)), (2, (0, 1)), (2, (1, 2, 1)))
# Filters of drives smooth. An exact position and an exact velocity under a held command obey a sum with a pole of
# alternating sign, which is no filter.
_LEAST_POLE = -0.01
# Units of a velocity in that of the position: SI, degrees, turns, millimetres, per minute; and the relative error of
# the period by which a driver divides.
_UNITS = np.array([1.0, np.pi / 180, 180 / np.pi, np.pi / 30, 30 / np.pi, 6.0, 1 / 6, 60.0, 1 / 60, 1e3, 1e-3])
_PERIOD = 0.03

# Stamps and findings by the identity of the outputs, which a record shares with its copies that carry other findings.
_known: dict[int, tuple[Array, list[Finding]]] = {}


@dataclass(frozen=True)
class Difference:
    """How a velocity follows from a position."""

    text: str  # kind of difference, for the user
    delay: float  # delay of the velocity behind the motion [s]
    misfit: float  # residual of the sum over the noise that it transmits


def difference(time: Array, position: Array, velocity: Array) -> Difference | None:
    """Return how a velocity was computed from a position; None where it was not, or where this cannot be decided.

    `time`, `position`, `velocity` (n,): measured at the same instants; NaN where not measured. Units do not matter.
    """
    known = np.isfinite(position) & np.isfinite(velocity) & np.isfinite(time)
    if np.sum(known) < _FEWEST or np.ptp(velocity[known]) == 0.0 or np.ptp(position[known]) == 0.0:
        return None
    t, p, v = time[known], position[known], velocity[known]
    # A quick test rules out most separate sensors.
    quick = _most_active(v, _QUICK)
    if t.size > _QUICK and np.sum(np.diff(v[quick]) != 0.0) > 2 * _FEWEST and _of(t[quick], p[quick], v[quick]) is None:
        return None
    whole = _most_active(v, _MOST)
    return _of(t[whole], p[whole], v[whole])


def differenced(record: Record) -> tuple[Finding, ...]:
    """Return a finding of kind `KIND` on every velocity of a record that was computed from a position.

    ``where`` is the velocity. Findings from before a record was cut or filtered stay valid.
    """
    earlier = [one for one in record.findings if one.kind == KIND]
    names = {one.where for one in earlier}
    stamps, found = _known.get(id(record.output), (None, []))
    if stamps is not record.time:
        found = differenced_columns(record.time, dict(zip(record.output_names, record.output.T, strict=True)))
        if stamps is None:
            finalize(record.output, _known.pop, id(record.output), None)
        _known[id(record.output)] = record.time, found
    return (*earlier, *(one for one in found if one.where not in names))


def differenced_columns(time: Array, columns: dict[str, Array]) -> list[Finding]:
    """As `differenced`, for columns (n,) by ``joint.field`` with common stamps (n,) [s]."""
    found = []
    for name, velocity in columns.items():
        joint, _, field = name.rpartition(".")
        position = columns.get(f"{joint}.position")
        if field != "velocity" or position is None:
            continue
        how = difference(time, position, velocity)
        if how is not None:
            cure = "fits leave it out, free runs are compared with it"
            text = f"{name} was computed from {joint}.position ({how.text}) and adds no information; {cure}"
            evidence = {"delay": how.delay, "misfit": how.misfit}
            found.append(Finding(KIND, text, where=name, level="warning", evidence=evidence, cure=cure))
    return found


def _most_active(velocity: Array, most: int) -> slice:
    """Return the stretch of at most so many samples that has the most change."""
    if velocity.size <= most:
        return slice(None)
    change = np.concatenate([[0.0], np.cumsum(np.diff(velocity) != 0.0)])
    first = int(np.argmax(change[most - 1 :] - change[: change.size - most + 1]))
    return slice(first, first + most)


def _of(t: Array, p: Array, v: Array) -> Difference | None:
    """As `difference`, where all samples are known."""
    step = np.diff(t)
    steady = float(np.median(step))
    if steady <= 0.0:
        return None
    # A driver divides by its own period, which the stamps may or may not show.
    periods = [np.full(step.size, steady)]
    if np.std(step) > 1e-6 * steady and np.all(step > 0.0):
        periods.append(step)
    for period in periods:
        d = np.diff(p) / period
        if found := _plain(v, d, steady) or _behind_filter(v, d, steady):
            return found
    return None


def _plain(v: Array, d: Array, step: float) -> Difference | None:
    """Return the plain difference over some samples that equals a velocity, if any; d[k] ends at v[k + 1]."""
    total = np.concatenate([[0.0], np.cumsum(d)])
    for wide in range(1, _WIDEST + 1):
        window = (total[wide:] - total[:-wide]) / wide
        # At the last sample, one sample later, or computed offline: centred, over one sample also ahead.
        for late in (0, 1, -1 if wide == 1 else -(wide // 2)):
            first = max(wide + late, 1)
            k = np.arange(first, min(v.size, v.size + late))
            found = _exact(v, d, window[k - wide - late][:, None], k, 0, np.ones(wide) / wide)
            if found is None:
                continue
            delay = (late + 0.5 * wide) * step
            ms = 1e3 * abs(delay)
            when = "centred" if delay == 0.0 else f"{ms:.3g} ms {'late' if delay > 0.0 else 'early'}"
            return Difference(f"difference over {wide} sample{'' if wide == 1 else 's'}, {when}", delay, found[1])
    return None


def _behind_filter(v: Array, d: Array, step: float) -> Difference | None:
    """Return the difference of the last sample behind a filter that equals a velocity, if any."""
    for order, shape in _FILTERS:
        taps = np.array(shape, dtype=float) / np.sum(shape)
        k = np.arange(max(len(taps), order), v.size)
        passed = sum(tap * d[k - 1 - j] for j, tap in enumerate(taps))
        found = _exact(v, d, np.column_stack([passed, *(v[k - i] for i in range(1, order + 1))]), k, order, taps)
        if found is None:
            continue
        poles, misfit = found
        lag = 0.5 + float(np.sum(taps * np.arange(taps.size)))
        lag += float(np.sum(poles * np.arange(1, order + 1)) / (1.0 - np.sum(poles)))
        return Difference(f"filtered difference, {1e3 * lag * step:.3g} ms late", lag * step, misfit)
    return None


def _exact(v: Array, d: Array, regressors: Array, k: Integers, order: int, taps: Array) -> tuple[Array, float] | None:
    """Return poles and misfit of a sum whose first regressor is the difference at k; None where it is not exact."""
    value = v[k]
    moving = (regressors[:, 0] != 0.0) | (value != v[k - 1])
    if np.sum(moving) < _FEWEST:
        return None
    regressors, value, unsplit = regressors[moving], value[moving], regressors[:, 0]
    response = np.convolve(taps, [1.0, -1.0])
    size = np.abs(regressors[:, 0])
    weights, error = _fitted(regressors, value, _fitted(regressors, value, size)[1])
    # Bounds of noise and error reject most sums here: that of one order of difference, and the median.
    if np.median(error) > _ROUNDING * abs(weights[0]) * _noise(unsplit, response, moving, _ORDERS[3:4]):
        return None
    weights, error = _fitted(regressors, value, error)
    gain, poles = weights[0], weights[1:]
    rest = 1.0 - float(np.sum(poles))
    if rest <= 0.0 or np.min(np.abs(abs(gain) / rest / _UNITS - 1.0)) > _PERIOD:
        return None
    roots = np.roots(np.concatenate([[1.0], -poles]))
    if np.any(roots.real < _LEAST_POLE) or np.any(np.abs(roots) >= 1.0):
        return None
    from scipy.signal import lfilter, lfiltic

    # The filter runs freely: another input, such as the command of an observer, may act on few samples only.
    filtering = ([gain], [1.0, *-poles])
    begin = lfiltic(*filtering, v[k[0] - order : k[0]][::-1])
    left = _trimmed(np.abs(v[k] - lfilter(*filtering, unsplit, zi=begin)[0])[moving], _ODD)
    impulse = np.zeros(_MEMORY)
    impulse[: response.size] = response
    share = float(np.linalg.norm(lfilter(*filtering, impulse)))
    noise = share * min(_noise(unsplit, response, moving, _ORDERS) / float(np.linalg.norm(response)), _unpredicted(d))
    return (poles, float(left / noise)) if left <= _ROUNDING * noise and noise > 0.0 else None


def _fitted(regressors: Array, v: Array, size: Array, odd: float = _ODD) -> tuple[Array, Array]:
    """Least squares without the share of samples of largest size; returns weights and absolute errors of all."""
    last = int((1.0 - odd) * (size.size - 1))
    keep = size <= np.partition(size, last)[last]
    weights = np.linalg.lstsq(regressors[keep], v[keep], rcond=None)[0]
    return weights, np.abs(v - regressors @ weights)


def _noise(passed: Array, response: Array, moving: Mask, orders: Sequence[int]) -> float:
    """Upper bound of the standard deviation of position noise in a sum, by the quietest of its higher differences."""
    size = float(np.linalg.norm(response))
    found = []
    for order in range(1, max(orders) + 1):
        passed, response, moving = np.diff(passed), np.convolve(response, [1.0, -1.0]), moving[1:]
        if order in orders:
            found.append(_trimmed(passed[moving], _JERKS) * size / float(np.linalg.norm(response)))
    return min(found)


def _unpredicted(d: Array) -> float:
    """Upper bound of the standard deviation of the position noise over the period; 0 where none is visible.

    The noise of the newest sample cannot be predicted from the differences before it.
    """
    windows = np.lib.stride_tricks.sliding_window_view(d, _PAST + 1)
    windows = windows[(windows[:, -1] != 0.0) | (windows[:, -2] != 0.0)]
    if len(windows) < 4 * _PAST:
        return 0.0
    past, last = windows[:, :-1], windows[:, -1]
    error = _fitted(past, last, np.abs(last), _JERKS)[1]
    left = _trimmed(_fitted(past, last, error, _JERKS)[1], _JERKS)
    return left if left > _LEAST_NOISE * float(np.sqrt(np.mean(np.square(d)))) else 0.0


def _trimmed(values: Array, share: float) -> float:
    """Root mean square without the share of the largest values."""
    count = max(int((1.0 - share) * values.size), 1)
    power = np.partition(np.square(values), count - 1)[:count]
    return float(np.sqrt(np.mean(power)))
