"""One noise model for all candidates where a disturbance is not part of the criterion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from idloop.diagnose.choice import SIMULATION
from idloop.estimate.dataset import output_groups
from idloop.estimate.likelihood.setting import Setting
from idloop.estimate.whitening import Whitener


def with_common_whitening(setting: Setting) -> Setting:
    """Give a setting of free runs no whitening at all; others keep each model's own.

    Free-run errors are model error through and through: nothing in them is a noise model's to take, and their serial
    correlation is reckoned with where evidence is weighed.

    Parameters
    ----------
    setting : Setting

    Returns
    -------
    Setting
    """
    if setting.kind != SIMULATION:
        return setting
    sizes = [len(group) for group in output_groups(list(setting.data))]
    return replace(setting, whiteners=tuple(Whitener(np.zeros((0, n, n))) for n in sizes))
