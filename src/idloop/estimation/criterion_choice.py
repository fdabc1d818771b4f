"""Which criterion suits the data, and why: the rule behind ``criterion="auto"``.

Where every body's motion is measured and the force balance of the fitted model leaves a part of the drive's force
that sensor noise does not account for, model error is what limits the fit, and the balance is the better question: an
observer would explain such an error as disturbance, so that friction comes out too small.

Everything else is fitted by prediction, and by free run to compare with. Were the
noise model right, prediction would be the more precise of the two. Where its
standard errors come out three times those of the free run on average, or eight
times for one parameter, the disturbance and the whitening have taken model error
for noise, and with it the trace of the parameters; if the free run then follows
the data at all (an error below half of the measured spread, outputs averaged), its
answer is the one to report. So it is where prediction cannot tell a parameter at all,
being a thousand times less precise: a constant force may be the disturbance's own. Of
parameters that neither can tell nothing is compared. A drive's gain that prediction cannot tell
from zero, while the free run follows the command, is one that it is blind to.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from idloop.estimation.dataset import Data
    from idloop.estimation.result import FitResult

Array = NDArray[np.float64]

PRECISION_RATIO = 3.0
SINGLE_RATIO = 8.0
BLIND_RATIO = 1e3
LARGEST_FREE_RUN_ERROR = 0.5
# A gain closer to zero than this many of its standard errors may be nothing.
_DEVIATIONS = 2.0


@dataclass(frozen=True)
class Choice:
    """A criterion's name and the reason for it, one sentence."""

    criterion: str
    why: str


def between(prediction: FitResult, simulation: FitResult, data: list[Data]) -> Choice:
    """Judge a fit by prediction against one by free run of the same model.

    Parameters
    ----------
    prediction, simulation : FitResult
    data : list of Data
        The records of both.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios = np.log(prediction.stderr / simulation.stderr)
    # What has no error by prediction has no trace left there beside the disturbance.
    ratios = np.where(np.isnan(prediction.stderr) & np.isfinite(simulation.stderr), np.inf, ratios)
    hidden = ratios > np.log(BLIND_RATIO)
    # Where the free run follows the command, a gain that may as well be nothing has not been seen.
    nothing = np.abs(prediction.values) < _DEVIATIONS * prediction.stderr
    moves = np.array([name == "drive.gain" for name in prediction.names])
    hidden |= nothing & moves & (simulation.values != 0.0)
    blind = [name for name, one in zip(prediction.names, hidden, strict=True) if one]
    ratios = ratios[np.isfinite(ratios) & ~hidden]
    ratio = float(np.exp(np.mean(ratios))) if len(ratios) else 1.0
    largest = float(np.exp(np.max(ratios))) if len(ratios) else 1.0
    error = np.concatenate([r.value for r in simulation.residuals])
    measured = np.concatenate([d.output for d in data])
    seen = np.any(np.isfinite(measured), axis=0)
    left = np.sqrt(np.nanmean(error[:, seen] ** 2, axis=0))
    spread = np.nanstd(measured[:, seen], axis=0)
    follows = bool(np.mean(left / np.maximum(spread, 1e-300)) < LARGEST_FREE_RUN_ERROR)
    if blind and follows and simulation.converged:
        return Choice(
            "simulation",
            f"prediction cannot tell {' and '.join(blind)} from a disturbance that its noise model allows; the free run"
            " can",
        )
    if (ratio > PRECISION_RATIO or largest > SINGLE_RATIO) and follows and simulation.converged:
        return Choice(
            "simulation",
            f"prediction would be up to {largest:.0f} times less precise than the free run: its noise model takes "
            "model error for noise, so something is missing from the model",
        )
    return Choice("prediction", prediction.why)
