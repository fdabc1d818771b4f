"""Which criterion suits the data, and why: the rule behind ``criterion="auto"``.

The prediction criterion is right when measurement noise and a slow disturbance
are what the model leaves over. On a real machine whose sensor is nearly free of
noise it is model error that is left over, and an observer that trusts such a
sensor explains that error as disturbance, so that friction comes out too small.
There the force balance in the excited band is the better question. It needs:

1. every body's motion measured;
2. a sensor so quiet that the differentiated acceleration is at most 0.1 % noise
   in power, which bounds the bias of an inertia by the same 0.1 %;
3. a recorded reference or excitation that explains at least half of the
   acceleration's power, so that instruments make the estimate consistent in the
   closed loop;
4. an unexplained force at least ten times what the sensor noise can account for
   and above 1 % of the drive force: model error, not noise, limits this fit.

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

from idloop.estimate.force import Balance, ForceCriterion, thin

if TYPE_CHECKING:
    from idloop.estimate.dataset import Data
    from idloop.estimate.result import FitResult
    from idloop.physics import Engine

Array = NDArray[np.float64]

QUIET_SHARE = 1e-3
NOISE_MULTIPLE = 10.0
LEAST_MODEL_ERROR = 0.01
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


def before_fit(balances: list[Balance | None]) -> Choice:
    """Judge conditions 1 to 3, which need no fit.

    Parameters
    ----------
    balances : list of Balance or None
        One per record; None where some body is not measured.

    Returns
    -------
    Choice
        ``force`` means that condition 4 is still to be judged.
    """
    known = [b for b in balances if b is not None]
    if len(known) < len(balances):
        return Choice("prediction", "not every body's motion is measured at a steady rate")
    share = max(float(np.max(b.motion.noise_share)) for b in known)
    if share > QUIET_SHARE:
        return Choice(
            "prediction",
            f"of the acceleration that a force balance needs {100 * min(share, 1.0):.3g} % would be measurement noise, "
            f"and it bears {100 * QUIET_SHARE:g} %",
        )
    if any(b.explained is None for b in known):
        return Choice(
            "prediction",
            "no recorded reference or excitation explains the motion, "
            "so a force balance could take disturbances for friction or inertia",
        )
    return Choice("force", "every body is measured with little noise and a reference explains the motion")


def after_fit(engine: Engine, criterion: ForceCriterion, theta: Array, nuisance: Array) -> Choice:
    """Judge condition 4 on a fitted force balance.

    Parameters
    ----------
    engine : Engine
    criterion : ForceCriterion
    theta, nuisance : array
        Fitted parameters.

    Returns
    -------
    Choice
    """
    left = np.concatenate(criterion.errors(theta, nuisance)[0])
    applied_power = noise_power = 0.0
    inertia = np.asarray(engine.layout(theta).axis.inertia, dtype=float)
    for b in criterion.balances:
        m = b.motion
        applied, _ = engine.drive_force(theta, m.position, m.velocity, m.acceleration, m.time, b.command(0.0), m.time)
        applied_power += float(np.mean(thin(applied[:, None], m) ** 2))
        noise = inertia**2 * m.noise_share * np.var(m.acceleration, axis=0)
        noise_power += float(np.sum(noise))
    applied_power /= len(criterion.balances)
    noise_power /= len(criterion.balances)
    left_power = float(np.sum(np.mean(left**2, axis=0)))
    relative = np.sqrt(left_power / applied_power) if applied_power > 0 else np.inf
    if left_power < NOISE_MULTIPLE**2 * noise_power or relative < LEAST_MODEL_ERROR:
        return Choice(
            "prediction",
            f"the force balance leaves {100 * relative:.2g} % of the drive force, "
            "which the sensor noise accounts for or which is too little to tell",
        )
    return Choice(
        "force",
        f"every body is measured so well that model error ({100 * relative:.2g} % of the drive force), "
        "not sensor noise, limits the fit; the force is compared up to "
        f"{max(b.motion.comparison_band for b in criterion.balances):.3g} Hz",
    )


def between(prediction: FitResult, simulation: FitResult, data: list[Data]) -> Choice:
    """Judge a fit by prediction against one by free run of the same model.

    Parameters
    ----------
    prediction, simulation : FitResult
    data : list of Data
        The records of both.

    Returns
    -------
    Choice
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
