"""Which criterion a diagnosis measures its models by.

Prediction is the rule: its noise model holds a disturbance and coloured noise, and its error
rate is calibrated. It misleads where what is left over is model error that an observer of a
nearly noise-free sensor explains away as disturbance. The force balance along the measured
motion tells: where it can be had at all, and fits clearly better with parameters of its own
than with those found by prediction, the two criteria disagree and the balance is followed.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from idloop.diagnose.setting import KINDS
from idloop.errors import IdloopError, InputError
from idloop.estimate import fit
from idloop.estimate.choose import before_fit
from idloop.estimate.dataset import prepare
from idloop.estimate.engine import RememberingEngine
from idloop.estimate.force import balance_of
from idloop.estimate.sensors import body_sensors, lagging_sensors
from idloop.physics.model import Model
from idloop.records import Record
from idloop.validate.drive import force_error

# Force error with the parameters of prediction over the one with the balance's own, for a model
# that is complete, and for one that may lack more than the effect just found.
DISAGREEMENT, FIRST_DISAGREEMENT = 1.15, 1.5
# ... the balance must explain more of the commanded force than this leaves [relative error] ...
NOTHING = 0.95
# ... and some parameter must differ by this part of itself and by this many standard errors.
LEAST_CHANGE, DEVIATIONS = 0.2, 5.0


def first_kind(criterion: str) -> str:
    """Criterion to begin with.

    Parameters
    ----------
    criterion : {"auto", "prediction", "simulation", "force"}

    Returns
    -------
    {"prediction", "simulation", "force"}

    Raises
    ------
    InputError
        Unknown criterion.
    """
    if criterion != "auto" and criterion not in KINDS:
        raise InputError(f"criterion {criterion!r} is unknown; choose auto, {', '.join(KINDS)}")
    return "prediction" if criterion == "auto" else criterion


def balance_disagrees(model: Model, records: Sequence[Record], ratio: float = DISAGREEMENT) -> bool:
    """Whether a force balance contradicts a model that was fitted by prediction.

    Parameters
    ----------
    model : Model
        Fitted by prediction.
    records : sequence of Record
    ratio : float
        Of the force errors, above which the two disagree.

    Returns
    -------
    bool
        False where the sensors are too noisy for a balance, some body is not measured or only by sensors
        that lag, or no recorded reference explains the motion.
    """
    if not model.free or _seen_late(model) or not _can_balance(model, records):
        return False
    try:
        own = fit(model, records, criterion="force")
        by_prediction = _force_error(model, records)
        by_balance = _force_error(own.model, records)
    except (IdloopError, np.linalg.LinAlgError):
        return False
    if by_prediction <= ratio * by_balance or by_balance > NOTHING:
        return False
    here = np.array([model.values[name] for name in own.names])
    spread = np.array([model.parameter(name).stderr or 0.0 for name in own.names])
    apart = np.abs(here - own.values)
    # A disturbance moves both fits a little, model error one of them a lot.
    far = apart > LEAST_CHANGE * np.maximum(np.abs(here), np.abs(own.values))
    sure = apart > DEVIATIONS * np.hypot(spread, np.where(np.isfinite(own.stderr), own.stderr, np.inf))
    return bool(np.any(far & sure))


def _seen_late(model: Model) -> bool:
    """Whether some body is measured only by sensors that show another motion than that of the moment."""
    late = lagging_sensors(model)
    return any(all(row is None or row in late for row in pair) for pair in body_sensors(model))


def _can_balance(model: Model, records: Sequence[Record]) -> bool:
    engine = RememberingEngine(model)
    data = prepare(model, records)
    first = [balance_of(engine, d, None) for d in data]
    known = [b for b in first if b is not None]
    if len(known) < len(first):
        return False
    cutoff = max(b.motion.cutoff for b in known)
    return (
        before_fit([balance_of(engine, d, r, cutoff) for d, r in zip(data, records, strict=True)]).criterion == "force"
    )


def _force_error(model: Model, records: Sequence[Record]) -> float:
    return float(np.sqrt(np.mean([force_error(model, record).relative ** 2 for record in records])))
