"""The period over position with which a remaining force repeats: magnets, teeth or a screw that nobody has named."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from idloop.estimate.engine import RememberingEngine
from idloop.estimate.force import balance_of
from idloop.estimate.likelihood.setting import Setting
from idloop.physics.model import Model

Array = NDArray[np.float64]

# Periods within the travel: fewer are a curve over it, more are not looked for.
FEWEST, MOST = 3.0, 400.0
# Samples that a period must last at typical speed.
_SAMPLES = 6.0
# Steps between neighbouring frequencies [periods within the travel], of the search and after it.
_STEP, _FINE = 0.25, 0.02
# The force is wanted up to so many times the frequency that the motion is excited to.
_WIDER = 4.0
# Neighbouring frequencies whose median is what a frequency has by itself.
_NEIGHBOURS = 101


class Period(NamedTuple):
    """A period and how it was found.

    Attributes
    ----------
    length : float
        In the unit of the position.
    tried : int
        Periods that were looked at.
    """

    length: float
    tried: int


def remaining_period(model: Model, setting: Setting) -> Period | None:
    """Find the period with which the force that the model lacks repeats most over the driven body's position.

    The force balance along the measured motion leaves a force at every instant; its spectrum over position, against
    what neighbouring frequencies have, shows what repeats. Linear in the number of samples.

    Parameters
    ----------
    model : Model
        Fitted.
    setting : Setting

    Returns
    -------
    Period or None
        None where the motion of some body is not measured, or the travel holds too few periods to tell.
    """
    runs = [run for run in _remaining(model, setting) if run is not None]
    if len(runs) < len(setting.data):
        return None
    low = min(float(np.min(place)) for place, _, _ in runs)
    span = max(float(np.max(place)) for place, _, _ in runs) - low
    stride = float(np.mean([moved for _, _, moved in runs]))
    if not (np.isfinite(span) and span > 0.0 and stride > 0.0):
        return None
    most = min(MOST, span / (_SAMPLES * stride))
    bins = int(8 * most)
    if most < 2.0 * FEWEST:
        return None
    total = np.zeros(bins)
    for place, force, _ in runs:
        at = np.minimum(((place - low) / span * bins).astype(np.int64), bins - 1)
        total += np.bincount(at, force - np.mean(force), bins)
    power = np.abs(np.fft.rfft(total, round(bins / _STEP))) ** 2
    frequency = _STEP * np.arange(len(power))
    inside = (frequency >= FEWEST) & (frequency <= most)
    from scipy.ndimage import median_filter

    usual = median_filter(power, _NEIGHBOURS, mode="nearest")
    stands = np.where(inside & (usual > 0.0), power / np.where(usual > 0.0, usual, 1.0), 0.0)
    if not np.any(stands > 0.0):
        return None
    near = frequency[int(np.argmax(stands))] + np.arange(-_STEP, _STEP, _FINE)
    exact = [sum(np.sum(f * np.exp(2j * np.pi * n / span * place)) for place, f, _ in runs) for n in near]
    return Period(span / float(near[int(np.argmax(np.abs(exact)))]), int(np.sum(inside)))


def _remaining(model: Model, setting: Setting) -> list[tuple[Array, Array, float] | None]:
    """Of each record the positions, the force that the balance lacks there, and the way of one sample (rms)."""
    engine = RememberingEngine(model)
    found: list[tuple[Array, Array, float] | None] = []
    for data in setting.data:
        with np.errstate(all="ignore"):
            narrow = balance_of(engine, data)
            if narrow is None:
                return [None]
            cutoff = min(_WIDER * narrow.motion.cutoff, 0.2 / narrow.motion.sample_time)
            balance = balance_of(engine, data, max(cutoff, narrow.motion.cutoff))
        if balance is None:
            return [None]
        m = balance.motion
        applied, required = engine.drive_force(
            None,
            m.position,
            m.velocity,
            m.acceleration,
            m.time,
            balance.command(0.0),
            m.time,
            conditions=balance.conditions,
        )
        place, force = m.position[:, 0], applied - required
        known = np.isfinite(place) & np.isfinite(force)
        moved = float(np.sqrt(np.mean(m.velocity[:, 0] ** 2))) * m.sample_time
        found.append((place[known], force[known], moved) if np.any(known) else None)
    return found
