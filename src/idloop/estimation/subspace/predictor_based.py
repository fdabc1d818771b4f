"""Optimised predictor-based subspace identification (PBSIDopt): consistent under any feedback."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from idloop.arrays import Array
from idloop.errors import InputError
from idloop.estimation.black_box.sampled import SampledData
from idloop.estimation.linear.model import LinearModel
from idloop.estimation.linear.sensitivity import Matrices
from idloop.estimation.subspace import realisation
from idloop.estimation.subspace.compression import Compression, compress, default_horizon, not_exciting
from idloop.estimation.subspace.model import assembled, command_matrices
from idloop.estimation.subspace.order import OrderSelection, check_order, significant
from idloop.estimation.subspace.projection import evidence_regression, project, regress, row_basis

Data = SampledData | Sequence[SampledData]

_UNPREDICTED = 1e-9  # deviation of what is new in a command, in deviations of the command
_FLOOR = 1e-8  # deviation of an innovation that counts as rounding, in deviations of its output


def pbsid(
    data: Data,
    order: int | Literal["auto"] = "auto",
    *,
    past: int | None = None,
    horizon: int | None = None,
    feedthrough: bool = False,
    stable: bool = False,
    integrates: bool = False,
) -> LinearModel:
    """State-space model from a long ARX model's predictors: no controller need be known.

    Chiuso, Automatica 43, 2007. One ARX regression gives the predictor's Markov parameters; from these follow the
    states, and from the states A, B, C, D and the Kalman gain by regression. The errors of an ARX model are new to
    the command however it was made, so that open and closed loop are alike; a long past makes the rest vanish, and a
    ridge of the greatest evidence keeps it harmless where the excitation is narrow.
    Chosen over SSARX, with which it is asymptotically equal, because all rows of the future come from one
    regression and the integrating plants of servo axes are seen through their stable predictor alone.

    Parameters
    ----------
    data : SampledData or sequence of SampledData
        Experiments in open or closed loop; offsets removed.
    order : int or "auto"
        Number of states.
    past : int, optional
        Lags of the ARX model; `default_horizon` by default.
    horizon : int, optional
        Samples of the future, at most `past`, which is the default.
    feedthrough : bool
        Estimate D; needs a command that does not answer the measurement of its own sample.
    stable : bool
        Reflect poles outside the unit circle into it before B and D are fitted.
    integrates : bool
        The plant is known to integrate: put the pole nearest 1 there before B and D are fitted.

    Raises
    ------
    InputError
        Too few samples, a command that follows from the past, an order that the horizon cannot show, or no pole near
        1 where the plant is to integrate.
    """
    regression = _regression(data, order, past, horizon, feedthrough)
    chosen = regression.selection().order if isinstance(order, str) else order
    compression, lags = regression.compression, regression.past
    states, following = regression.states(chosen)
    commands, now = compression.u(lags, lags + 1), compression.y(lags, lags + 1)
    shown = np.concatenate([states, commands]) if feedthrough else states
    c_d = regress(now, shown)
    errors = now - c_d @ shown
    moved = np.concatenate([states, commands, errors])
    # Errors that are rounding are left out: the gain from them would be meaningless.
    moved[len(moved) - len(errors) :][np.linalg.norm(errors, axis=1) < _FLOOR] = 0.0
    coefficients = regress(following, moved)
    m = compression.inputs
    a, c = coefficients[:, :chosen], c_d[:, :chosen]
    gain = coefficients[:, chosen + m :]
    notes: tuple[str, ...] = ()
    a = realisation.constrained(a, stable=stable, integrates=integrates)
    if np.max(np.abs(np.linalg.eigvals(a - gain @ c))) >= 1.0:
        rest = following - a @ states - coefficients[:, chosen : chosen + m] @ commands
        gain, notes = realisation.kalman_gain(realisation.noise(np.concatenate([rest, errors]), chosen), a, c)
    b, d, covariance = command_matrices(compression, a, c, gain, feedthrough)
    return assembled(
        "pbsid", compression, Matrices(a, b, c, d, gain), regression.values, feedthrough, notes, covariance
    )


@dataclass(frozen=True)
class _Regression:
    """Long ARX model and the decomposition of the states that it sees."""

    compression: Compression  # of windows one sample longer than the past
    past: int
    horizon: int
    # Shape (p horizon, (m + p) past): extended observability times controllability matrix of the predictor, in
    # deviations of the innovations; singular vectors and values of its product with the past
    shifted: Array
    left: Array
    values: Array

    def states(self, order: int) -> tuple[Array, Array]:
        """States at the window's last sample and one later, shape (order, columns)."""
        into = (self.left[:, :order] / np.sqrt(self.values[:order])).T @ self.shifted
        return into @ self.compression.both(0, self.past), into @ self.compression.both(1, self.past + 1)

    def selection(self) -> OrderSelection:
        """Order by the canonical correlations of the past with what it predicts in white errors."""
        rows, columns = self.shifted.shape
        # The future without its own predictable part has unit covariance: the correlation follows from its share.
        correlations = self.values / np.sqrt(1.0 + self.values**2)
        order, threshold = significant(correlations, columns, rows, self.compression.windows)
        return OrderSelection("pbsid", self.horizon, self.values, correlations, threshold, order)


def _regression(
    data: Data, order: int | Literal["auto"], past: int | None, horizon: int | None, feedthrough: bool
) -> _Regression:
    known = None if isinstance(order, str) else order
    lags = default_horizon(data, known, feedthrough) if past is None else past
    ahead = lags if horizon is None else horizon
    if not 2 <= ahead <= lags:
        raise InputError(f"horizon of {ahead} samples with a past of {lags}; give 2 to {lags}")
    compression = compress(data, lags + 1)
    check_order(order, ahead, compression.outputs)
    before, now = compression.both(0, lags), compression.y(lags, lags + 1)
    commands = compression.u(lags, lags + 1)
    _check_excitation(compression, before, commands, now)
    regressors = np.concatenate([before, commands]) if feedthrough else before
    coefficients = evidence_regression(now, regressors, compression.windows, _FLOOR)
    errors = now - coefficients @ regressors
    wide, p = compression.inputs + compression.outputs, compression.outputs
    whitener = np.linalg.inv(np.linalg.cholesky(errors @ errors.T + _FLOOR**2 * np.eye(p)))
    markov = whitener @ coefficients[:, : lags * wide]
    shifted = np.zeros((ahead * p, lags * wide))
    for later in range(ahead):
        # Samples before the past are neglected: what lies `later` samples ahead sees that much less of it.
        shifted[later * p : (later + 1) * p, later * wide :] = markov[:, : (lags - later) * wide]
    left, values, _ = np.linalg.svd(shifted @ before, full_matrices=False)
    return _Regression(compression, lags, ahead, shifted, left, values)


def _check_excitation(compression: Compression, before: Array, commands: Array, now: Array) -> None:
    known = row_basis(np.concatenate([before, now]))
    new = np.linalg.norm(commands - project(commands, known), axis=1)
    if np.any(new <= _UNPREDICTED):
        excited = compression.excited()
        if excited < compression.length * compression.inputs:
            raise not_exciting(compression, excited, compression.length)
        name = compression.experiments[0].input_names[int(np.argmin(new))]
        raise InputError(
            f"{compression.experiments[0].name}: {name} follows from its own past and the measurements;"
            " excite the reference or the command with a richer signal, or shorten the past"
        )
