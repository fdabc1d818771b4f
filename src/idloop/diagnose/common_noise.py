"""One noise model for all candidates where a disturbance is not part of the criterion.

In a force balance what is missing from the model and what is noise stand side by side in
the errors. A whitening taken from a poor model would take its missing effects for noise and
swallow them; it is taken from the richest description instead: the model with every effect
of the catalogue at once, linear in their strengths.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from idloop.diagnose.proposals import proposals
from idloop.diagnose.refit import refit
from idloop.diagnose.screen import Screen
from idloop.diagnose.setting import Setting
from idloop.estimate.dataset import output_groups
from idloop.estimate.whitening import Whitener, choose_order, fit_whitener
from idloop.physics.model import Model

# Directions that the richest description may have, as part of the samples.
_RICHEST = 0.1


def with_common_whitening(setting: Setting, model: Model) -> Setting:
    """Give a force setting the whitening of the richest description; others keep each model's own.

    Parameters
    ----------
    setting : Setting
    model : Model
        Where the catalogue is added to.

    Returns
    -------
    Setting
    """
    if setting.kind == "simulation":
        # Free-run errors are model error through and through: nothing in them is a noise model's
        # to take, and their serial correlation is reckoned with where evidence is weighed.
        sizes = [len(group) for group in output_groups(list(setting.data))]
        return replace(setting, whiteners=tuple(Whitener(np.zeros((0, n, n))) for n in sizes))
    if setting.kind != "force":
        return setting
    outputs = len(model.bodies)
    plain = replace(setting, whiteners=(Whitener(np.zeros((0, outputs, outputs))),))
    screen = Screen(plain, refit(plain, model), seed=0)
    columns = [screen.basis]
    for proposal in proposals(screen.parent.model):
        for trials in proposal.alternatives(screen.sizes.at(proposal.effect.site, proposal.at)):
            moved = [screen.moved(proposal, trial) for trial in trials]
            columns += [
                column[:, None] / np.linalg.norm(column) for column in moved if column is not None and np.any(column)
            ]
    left, weight, _ = np.linalg.svd(np.concatenate(columns, axis=1), full_matrices=False)
    count = min(int(np.sum(weight > 1e-3 * weight[0])), int(_RICHEST * len(screen.errors)))
    rest = screen.errors - left[:, :count] @ (left[:, :count].T @ screen.errors)
    lengths = [len(e) * outputs for e in screen.parent.problem.errors(screen.parent.point)[0]]
    parts = [part.reshape(-1, outputs) for part in np.split(rest, np.cumsum(lengths)[:-1])]
    return replace(setting, whiteners=(fit_whitener(parts, choose_order(parts)),))
