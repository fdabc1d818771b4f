"""Whether the measured motion follows the command at all.

Columns of two runs, a drive that was off, a motor that was turned by hand: there a fit finds a machine so heavy or so
stiff that the command hardly counts, and an effect that takes the rest of it away is an improvement. Nothing that such
data say is about the axis. They are told by what a model predicts with the command, and with its mean in its place. A
model that lacks the very effect through which the command is seen does no better either: the model that has it does.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from idloop.diagnose.choice import NOTHING
from idloop.diagnose.evidence import distinguishable
from idloop.diagnose.refit import Refit, transfer
from idloop.diagnose.setting import Setting
from idloop.errors import IdloopError
from idloop.validate.drive import force_error

UNMOVED = (
    "the measured motion does not follow the command: the model predicts it no better with the command than without. "
    "Was the drive on, and are command and motion of the same run and the same joint?"
)
REFUSED = "with it, too, the motion does not follow the command"


def follows(setting: Setting, fit: Refit) -> bool:
    """Whether a fitted model predicts the motion better with the command than without.

    Parameters
    ----------
    setting : Setting
        What it was fitted to.
    fit : Refit

    Returns
    -------
    bool
        True as well where that cannot be computed.
    """
    if setting.kind == "force":
        return _balances(setting, fit)
    still = tuple(replace(one, input=np.full_like(one.input, np.mean(one.input))) for one in setting.data)
    without = transfer(replace(setting, data=still), fit, own_disturbance=True)
    return without is None or distinguishable(fit, without)


def _balances(setting: Setting, fit: Refit) -> bool:
    """Whether a balance of forces along the measured motion explains anything of the commanded force."""
    try:
        errors = [force_error(fit.model, record).relative for record in setting.records]
    except (IdloopError, np.linalg.LinAlgError):
        return True
    return float(np.sqrt(np.mean(np.square(errors)))) < NOTHING


def unmoved(findings: Iterable[str]) -> bool:
    """Whether the findings of a diagnosis or a ladder say that the motion does not follow the command."""
    return UNMOVED in findings
