"""Average run length of a CUSUM until an alarm, false or true, and the threshold for a given false-alarm rate.

Page's test adds up log-likelihood ratios of a growth against none and restarts when the sum falls below 0
(Page, Biometrika 41, 1954; Basseville and Nikiforov, Detection of Abrupt Changes, 1993, ch. 5). Its average run
length is that of a Brownian motion with the drift and variance of the ratios, the overshoot over the threshold
taken into account (Siegmund, Sequential Analysis, 1985, ch. 2).

Offset and variance of the ratios are estimated from a healthy reference of finite length. A threshold that ignores
their uncertainty gives too many false alarms, so the rate is averaged over their distribution (Jones, Champ and
Rigdon, J. Quality Technology 36, 2004, on the CUSUM with estimated parameters).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from idloop.arrays import Array
from idloop.errors import IdloopError

# Mean excess of a Gaussian walk over a boundary, in standard deviations of a step, at both boundaries of the test.
_OVERSHOOT = 2.0 * 0.5826
_LEAST_THRESHOLD = 3.0
# A block adds at most the threshold over this number: a single shock to the machine raises no alarm.
FEWEST_BLOCKS = 2.5
_NODES = 41


@dataclass(frozen=True)
class Evidence:
    """Information of a record about one watch."""

    # Mean log-likelihood ratio by which an informative block lowers the sum of a healthy machine, positive: half the
    # squared growth times the information of the block
    ratio: float
    informative: float  # share of the blocks that are informative, in (0, 1]
    blocks: float  # number of informative blocks

    @property
    def offset_stderr(self) -> float:
        """Standard error of the reference's own offset, in units of the watched growth."""
        return float(1.0 / np.sqrt(2.0 * self.ratio * self.blocks))


def run_length(threshold: ArrayLike, drift: ArrayLike, variance: ArrayLike) -> Array:
    """Average number of blocks until a CUSUM that starts at 0 crosses the threshold.

    `threshold`: positive. `drift`: mean of a block's ratio; negative for a healthy machine. `variance`: its variance,
    positive. Returns: of the common shape; infinite where a number would overflow.
    """
    step = np.sqrt(np.asarray(variance, dtype=float))
    barrier = np.asarray(threshold, dtype=float) / step + _OVERSHOOT
    slope = np.asarray(drift, dtype=float) / step
    slope = np.where(np.abs(slope) < 1e-9, 1e-9, slope)
    x = -2.0 * slope * barrier
    # (e^x - x - 1) / (2 slope²); its series where the difference would be rounding only.
    small = np.abs(x) < 1e-4
    with np.errstate(over="ignore"):
        value = np.where(small, 0.5 * x**2 * (1.0 + x / 3.0), np.expm1(x) - x)
    return np.asarray(np.maximum(value / (2.0 * slope**2), 1.0))


def false_alarm_rate(threshold: float, evidence: Evidence) -> float:
    """False alarms per block, averaged over the uncertainty of the reference."""
    from scipy.stats import chi2

    nodes, weights = np.polynomial.hermite_e.hermegauss(_NODES)
    shares = (np.arange(_NODES) + 0.5) / _NODES
    # The estimated long-run variance has a chi-square distribution with about so many degrees of freedom.
    freedom = max(evidence.blocks - 1.0, 1.0)
    wider = freedom / chi2.ppf(shares, freedom)
    offset = nodes[:, None] * evidence.offset_stderr * np.sqrt(wider)
    drift = -evidence.ratio * (1.0 - 2.0 * offset)
    rate = 1.0 / run_length(threshold, drift, 2.0 * evidence.ratio * wider)
    return float(evidence.informative * (weights / np.sum(weights)) @ np.mean(rate, axis=1))


def find_threshold(blocks: float, evidence: Evidence) -> float:
    """Threshold with one false alarm in so many blocks, on average over references.

    `blocks`: blocks of running between two false alarms. Raises IdloopError: the reference is too short for any
    threshold.
    """
    # Below the least threshold a slight error of the model would raise an alarm.
    low, high = _LEAST_THRESHOLD, _most(blocks)
    if false_alarm_rate(high, evidence) > 1.0 / blocks:
        raise IdloopError("the reference is too short for so few false alarms")
    while high - low > 1e-3:
        middle = 0.5 * (low + high)
        if false_alarm_rate(middle, evidence) > 1.0 / blocks:
            low = middle
        else:
            high = middle
    return high


def needed_reference(blocks: float, evidence: Evidence) -> float:
    """Factor by which the reference has to be longer for a threshold with a practical detection delay.

    `blocks`: blocks of running between two false alarms. Returns: 1 where it is long enough.
    """
    factor = 1.0
    while factor < 1e6:
        longer = Evidence(evidence.ratio, evidence.informative, evidence.blocks * factor)
        if false_alarm_rate(_most(blocks), longer) <= 1.0 / blocks:
            return factor
        factor *= 1.25
    return factor


def _most(blocks: float) -> float:
    """Largest practical threshold: twice that of a reference of infinite length."""
    return 2.0 * float(np.log(max(blocks, 1.0))) + 2.0 * _LEAST_THRESHOLD


def detection_delay(threshold: float, evidence: Evidence, growth: float = 1.0) -> float:
    """Average number of blocks, uninformative ones included, from a sudden growth to its alarm.

    `evidence`: of the data that are monitored; `growth`: in units of the watched growth. Returns: infinite for a growth
    of at most half the watched one, which the test does not detect.
    """
    drift = evidence.ratio * (2.0 * growth - 1.0)
    if drift <= 0.0:
        return float("inf")
    blocks = max(float(run_length(threshold, drift, 2.0 * evidence.ratio)), np.ceil(FEWEST_BLOCKS))
    return float(blocks) / evidence.informative
