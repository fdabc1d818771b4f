"""Periods over position with which a remaining force repeats (magnets, teeth, a screw): any, or parts of a turn."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from idloop.estimation.force_balance.force_error import record_balance
from idloop.estimation.force_balance.weak_fit import WeakFit
from idloop.estimation.force_balance.weak_form import test_functions
from idloop.estimation.likelihood.estimation_problem import EstimationProblem
from idloop.estimation.optimisation.caching_engine import CachingEngine
from idloop.estimation.statistics.student import weights
from idloop.physics.model import Model
from idloop.physics.trial import FEWEST_PERIODS

Array = NDArray[np.float64]

# Highest number of periods within the travel, or within a turn.
_MOST = 400
# Least part of the windows' power that a wave keeps.
_LEAST_KEPT = 0.1
# Bands of speed and cells of a turn over which forces are summed; most periods in a window of which some are kept.
_SPEEDS, _CELLS, _LONGEST = 128, 4096, 4.0
# Shortest period that is looked for in windows [travel in a window at typical speed]: its test function keeps a third.
_SHORTEST = 0.6
# Periods within the travel by which a period is off a harmonic of the turn that the records can tell from it.
_BETWEEN = 0.25
# Harmonics whose forces are looked at: their powers only rank them, as they overlap where turns are few.
_STRONGEST = 12
# Step between neighbouring frequencies [periods within the travel].
_STEP = 0.25


def residual_period(model: Model, estimation: EstimationProblem) -> tuple[float, int] | None:
    """Period over the driven body's position with which the force that a fitted model lacks repeats most.

    With the number of periods that were tried: of six samples at typical speed at least. None where the motion of some
    body is not measured, or the travel contains too few periods.
    """
    # The force balance along the measured motion leaves a force at every instant; its spectrum over position, against
    # what neighbouring frequencies have, shows what repeats. Linear in the number of samples.
    engine, runs, strides = CachingEngine(model), [], []
    for data in estimation.data:
        with np.errstate(all="ignore"):
            narrow = record_balance(engine, data)
            if narrow is None:
                return None
            # The force has frequencies above those of the motion.
            cutoff = min(4.0 * narrow.motion.cutoff, 0.2 / narrow.motion.sample_time)
            balance = record_balance(engine, data, max(cutoff, narrow.motion.cutoff))
        if balance is None:
            return None
        m = balance.motion
        along = (m.position, m.velocity, m.acceleration, m.time, balance.command.mean, m.time)
        place, force = m.position[:, 0], -engine.balance(None, *along, conditions=balance.conditions).residual[:, 0]
        known = np.isfinite(place) & np.isfinite(force)
        if not np.any(known):
            return None
        runs.append((place[known], force[known]))
        strides.append(float(np.sqrt(np.mean(m.velocity[:, 0] ** 2))) * m.sample_time)
    return strongest_period(runs, 6.0 * float(np.mean(strides)))


def unexplained_period(fit: WeakFit, body: int) -> tuple[float, int] | None:
    """Period over the position with which the unexplained force of a body repeats most, and how many were tried.

    Of a part of a window at typical speed at least, which keeps a third of a wave; see `strongest_period`.
    """
    form = fit.form
    residual = fit.residual[:, body] * weights(fit.residual[:, body] / fit.scale[body])
    window = form.width * form.sample_time * float(np.sqrt(np.mean(form.along("velocity", body) ** 2)))
    return strongest_period([(form.along("position", body), residual)], _SHORTEST * window)


def period_between_harmonics(fit: WeakFit, body: int) -> tuple[float, int] | None:
    """As `unexplained_period`, for an angle: None unless a wave explains more than both harmonics next to its period.

    Two harmonics that act together beat as a period between them does over a part of a turn, and then fit as well.
    """
    found = unexplained_period(fit, body)
    if found is None:
        return None
    period, tried = found
    form, waves = fit.form, 2.0 * np.pi / period
    angle, lower = form.motion.position[:, body], np.floor(waves)
    turns = float(np.ptp(angle)) / (2.0 * np.pi)
    if min(waves - lower, lower + 1.0 - waves) * turns < _BETWEEN:
        return None
    residual, slopes = fit.residual[:, body], fit.linear[1][:, body]
    weight = np.sqrt(weights(residual / fit.scale[body]))

    def left_beside(orders: Sequence[float]) -> float:
        several = [form.weak(np.column_stack([np.sin(n * angle), np.cos(n * angle)])) for n in orders]
        columns = np.hstack([slopes, *several]) * weight[:, None]
        columns = columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
        heights = np.linalg.lstsq(columns, residual * weight, rcond=1e-6)[0]
        return float(np.linalg.norm(residual * weight - columns @ heights))

    ahead = len(residual) * np.log(left_beside([lower, lower + 1.0]) / max(left_beside([waves]), 1e-300))
    return found if ahead > np.log(tried) else None


def strongest_period(runs: Sequence[tuple[Array, Array]], shortest: float) -> tuple[float, int] | None:
    """Period over the position with which a force repeats most, and how many were tried.

    `runs` are positions and forces; a shorter period than `shortest` is not looked for. None where the travel contains
    too few periods.
    """
    from scipy.ndimage import median_filter

    low = min(float(np.min(place)) for place, _ in runs)
    span = max(float(np.max(place)) for place, _ in runs) - low
    if not (np.isfinite(span) and span > 0.0 and shortest > 0.0):
        return None
    # Less than three within the travel are a curve over it.
    fewest, most = 3.0, min(float(_MOST), span / shortest)
    bins = int(8 * most)
    if most < 2.0 * fewest:
        return None
    total = np.zeros(bins)
    for place, force in runs:
        at = np.minimum(((place - low) / span * bins).astype(np.int64), bins - 1)
        total += np.bincount(at, force - np.mean(force), bins)
    power = np.abs(np.fft.rfft(total, round(bins / _STEP))) ** 2
    frequency = _STEP * np.arange(len(power))
    inside = (frequency >= fewest) & (frequency <= most)
    # The spectrum around each frequency.
    usual = median_filter(power, 101, mode="nearest")
    stands = np.where(inside & (usual > 0.0), power / np.where(usual > 0.0, usual, 1.0), 0.0)
    if not np.any(stands > 0.0):
        return None
    near = frequency[int(np.argmax(stands))] + np.arange(-_STEP, _STEP, 0.02)
    exact = [sum(np.sum(f * np.exp(2j * np.pi * n / span * place)) for place, f in runs) for n in near]
    return span / float(near[int(np.argmax(np.abs(exact)))]), int(np.sum(inside))


def harmonics(fit: WeakFit, body: int) -> tuple[tuple[int, ...], int]:
    """Harmonics of a turn, from 2 on, with the most power in the unexplained force of a body, and how many were tried.

    Strongest first; empty where the motion contains too few turns. Each window counts by what it keeps of a wave at its
    speed: a wave that fast windows average out may show in slow ones.
    """
    form = fit.form
    angle, speed = form.along("position", body), np.abs(form.along("velocity", body))
    turns = float(np.ptp(angle)) / (2.0 * np.pi)
    left = fit.residual[:, body]
    left = left * weights(left / fit.scale[body])
    # Sums over cells of equal speed and angle, whose spectra over the angle give all harmonics at once.
    per_window = form.width * form.sample_time * speed / (2.0 * np.pi)
    edges = np.geomspace(0.1 / _MOST, _LONGEST, _SPEEDS)
    band = np.searchsorted(edges, per_window)
    cell = np.minimum((angle % (2.0 * np.pi)) * (_CELLS / (2.0 * np.pi)), _CELLS - 1).astype(np.int64)
    sums = np.bincount(band * _CELLS + cell, left, (_SPEEDS + 1) * _CELLS).reshape(-1, _CELLS)
    counts = np.bincount(band, minlength=_SPEEDS + 1)
    typical = np.bincount(band, per_window, _SPEEDS + 1) / np.maximum(counts, 1)
    # What the test function keeps of a wave, by the periods in a window.
    periods = np.linspace(0.0, _LONGEST, 201)
    shape = test_functions(form.width, form.sample_time)[0]
    share = np.abs(np.exp(2j * np.pi * np.outer(periods, np.arange(form.width) / form.width)) @ shape)
    lowest = max(2, int(np.ceil(FEWEST_PERIODS / max(turns, 1e-12))))
    orders = np.arange(lowest, _MOST + 1)
    kept = np.interp(np.outer(typical, orders), periods, share, right=0.0)
    power = counts @ kept**2
    weak = np.flatnonzero(power < _LEAST_KEPT * len(left))
    tried = int(weak[0]) if len(weak) else len(orders)
    wave = np.sum(kept * np.fft.rfft(sums, axis=1)[:, lowest : _MOST + 1], axis=0)[:tried]
    strongest = np.argsort(np.abs(wave) / np.sqrt(power[:tried]))[::-1][:_STRONGEST]
    return tuple(int(order) for order in orders[strongest]), tried
