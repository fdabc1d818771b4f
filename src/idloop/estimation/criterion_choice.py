"""Choice between the criteria, and its reason: the rule of ``criterion="auto"``.

Where the motion of all bodies is measured and the force balance leaves more unexplained force than the sensor noise,
model error limits the fit, and the balance is used: an observer would explain a part of that force as disturbance, and
underestimate friction. A loop of the drive with an unknown proportional gain scales all forces: there the balance does
not decide.

Otherwise the model is fitted by prediction, and by free run for comparison. With a correct noise model prediction is
the more precise of the two. Where its standard errors are three times those of the free run on average, or eight times
for one parameter, its noise model explains model error as noise; of a value that is smaller by prediction, they are
compared as parts of the values. The free run is then used if its error is below half
of the measured standard deviation, averaged over the outputs. It is also used where prediction does not determine a
parameter at all, as with a constant force beside the disturbance, or a drive gain that may be zero, and where the
values of prediction miss the measurement in free run by eight times as much. Parameters that neither determines are not
compared.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from idloop.estimation.dataset import Data
    from idloop.estimation.result import FitResult, RecordResidual


PRECISION_RATIO = 3.0
SINGLE_RATIO = 8.0
BLIND_RATIO = 1e3
LARGEST_FREE_RUN_ERROR = 0.5
# Prediction whose values miss the measurement in free run by so many times the least error has explained model error as
# noise: a disturbance that it has found rightly lets the least error be a few times smaller.
_MISSED_RATIO = 8.0
# A gain closer to zero than this many standard errors may be zero.
_DEVIATIONS = 2.0


@dataclass(frozen=True)
class Choice:
    """A criterion's name and the reason for it, in one sentence."""

    criterion: str
    why: str


def choose_criterion(
    prediction: FitResult, simulation: FitResult, data: list[Data], predicted: Sequence[RecordResidual]
) -> Choice:
    """Choose between a fit by prediction and one by free run of the same model to the same records.

    `predicted`: errors of the free run with the values of prediction.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios = np.log(prediction.stderr / simulation.stderr)
        # Of each value its own part: one that a disturbance has taken over is small, and so is its error.
        smaller = np.log(simulation.values / prediction.values)
        ratios += np.where(np.isfinite(smaller), np.maximum(smaller, 0.0), 0.0)
    # A parameter without a standard error by prediction is explained by the disturbance.
    ratios = np.where(np.isnan(prediction.stderr) & np.isfinite(simulation.stderr), np.inf, ratios)
    hidden = ratios > np.log(BLIND_RATIO)
    # Where the free run follows the command, prediction does not determine a gain that may be zero.
    maybe_zero = np.abs(prediction.values) < _DEVIATIONS * prediction.stderr
    is_gain = np.array([name == "drive.gain" for name in prediction.names])
    hidden |= maybe_zero & is_gain & (simulation.values != 0.0)
    blind = [name for name, one in zip(prediction.names, hidden, strict=True) if one]
    ratios = ratios[np.isfinite(ratios) & ~hidden]
    ratio = float(np.exp(np.mean(ratios))) if len(ratios) else 1.0
    largest = float(np.exp(np.max(ratios))) if len(ratios) else 1.0
    missed, least = _relative_error(predicted, data), _relative_error(simulation.residuals, data)
    follows = least < LARGEST_FREE_RUN_ERROR
    if blind and follows and simulation.converged:
        return Choice(
            "simulation",
            f"prediction cannot tell {' and '.join(blind)} from the disturbance of its noise model; the free run can",
        )
    if (ratio > PRECISION_RATIO or largest > SINGLE_RATIO) and follows and simulation.converged:
        return Choice(
            "simulation",
            f"prediction would be up to {largest:.0f} times less precise than the free run: its noise model explains "
            "model error as noise, so an effect is missing from the model",
        )
    if missed > _MISSED_RATIO * least and follows:
        return Choice(
            "simulation",
            f"with the values of prediction the free run misses {percent(missed)} of the signal, and {percent(least)}"
            " at best: the noise model explains model error as noise, so an effect is missing from the model",
        )
    return Choice("prediction", prediction.why)


def _relative_error(residuals: Sequence[RecordResidual], data: list[Data]) -> float:
    """Rms error over the deviation of the measurement, averaged over the outputs."""
    error = np.concatenate([one.value for one in residuals])
    measured = np.concatenate([one.output for one in data])
    seen = np.any(np.isfinite(measured), axis=0)
    left = np.sqrt(np.nanmean(error[:, seen] ** 2, axis=0))
    return float(np.mean(left / np.maximum(np.nanstd(measured[:, seen], axis=0), 1e-300)))


def percent(share: float) -> str:
    """Two digits of a share, and no more digits of a large one than stand before the point."""
    value = 100.0 * share
    return f"{value:.0f} %" if value >= 10.0 else f"{value:.2g} %"
