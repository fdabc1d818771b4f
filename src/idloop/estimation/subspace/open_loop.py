"""N4SID, MOESP and CVA: subspace identification of data whose input does not depend on the noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Literal

import numpy as np

from idloop.estimation.black_box.sampled import SampledData
from idloop.estimation.linear.model import LinearModel
from idloop.estimation.linear.sensitivity import Matrices
from idloop.estimation.subspace import realisation
from idloop.estimation.subspace.compression import Compression, halved_windows
from idloop.estimation.subspace.model import assembled, command_matrices
from idloop.estimation.subspace.order import OrderSelection, check_order, significant
from idloop.estimation.subspace.realisation import Future, project_future

Data = SampledData | Sequence[SampledData]

# Horizons and samples of each experiment, whichever is longer, on which the free runs of the two models are compared.
_COMPARED, _LEAST_COMPARED = 150, 4000


def n4sid(
    data: Data,
    order: int | Literal["auto"] = "auto",
    *,
    horizon: int | None = None,
    feedthrough: bool = False,
    focus: Literal["prediction", "simulation"] = "prediction",
    stable: bool = False,
    integrates: bool | None = None,
    exact: bool = False,
    method: realisation.Weighting = "n4sid",
) -> LinearModel:
    """State-space model from the oblique projection of the future on the past.

    A and C by regression of states (Van Overschee and De Moor, Subspace Identification for Linear Systems, 1996,
    figure 4.8), Kalman gain by the Riccati equation of what the regression leaves, B and D by least squares on the
    outputs. Consistent where the input does not depend on the noise; under feedback use `pbsid` or `vodma`.

    Parameters
    ----------
    data : SampledData or sequence of SampledData
        Experiments of one system; offsets removed.
    order : int or "auto"
        Number of states; "auto" counts canonical correlations above those of noise (`select_order`).
    horizon : int, optional
        Samples of past and of future; `default_horizon` by default.
    feedthrough : bool
        Estimate D. A measurement that is taken before the command of its stamp has none.
    focus : "prediction" or "simulation"
        Which outputs B and D are fitted on: those predicted with the Kalman gain, or the free run.
    stable : bool
        Reflect poles outside the unit circle into it before B and D are fitted.
    integrates : bool, optional
        Whether the plant is known to integrate: the pole nearest 1 is put there before B and D are fitted. A window
        shows hardly anything of a pole that forgets over many windows; where one is as slow as that and nothing is
        given, the free run of the data decides.
    exact : bool
        Factor the windows themselves (QR), whatever the data. By default the correlations of the signals replace
        them wherever the data have the noise to allow it: many times faster, and equal well within the chance error.
    method : "n4sid", "moesp" or "cva"
        Weights of the projection, and how A and C follow from it.

    Raises
    ------
    InputError
        Too few samples, an input that excites too little, an order that the horizon cannot show, or no pole near 1
        where the plant is to integrate.
    """
    compression, future = _projected(data, order, horizon, feedthrough, exact)
    subspace = realisation.weighted_subspace(future, method)
    chosen = selection(method, compression, future, subspace).order if isinstance(order, str) else order
    observability = subspace.observability(chosen)
    transition = realisation.transition(future, observability)
    residual = transition.orthogonal_to(future.command)
    if method == "moesp":
        a, c = realisation.shift_invariant(observability, compression.outputs)
    else:
        a, c = realisation.regressed(future, transition)

    def model(known: bool) -> LinearModel:
        poles = realisation.constrained(a, stable=stable, integrates=known)
        gain, notes = realisation.kalman_gain(realisation.residual_noise(residual, poles, c), poles, c)
        fitted = gain if focus == "prediction" else np.zeros_like(gain)
        b, d, covariance = command_matrices(compression, poles, c, fitted, feedthrough)
        found = Matrices(poles, b, c, d, gain)
        left = covariance if focus == "prediction" else None
        return assembled(method, compression, found, subspace.values, feedthrough, notes, left)

    if integrates is not None or not realisation.beyond_windows(a, future.horizon):
        return model(bool(integrates))
    opening = max(_COMPARED * future.horizon, _LEAST_COMPARED)
    return _better_free_run(model(False), model(True), [one.part(0, opening) for one in compression.experiments])


def moesp(data: Data, order: int | Literal["auto"] = "auto", **options: Any) -> LinearModel:
    """State-space model from the shift of the observability matrix, past signals as instruments (PO-MOESP).

    Verhaegen, Automatica 30, 1994. Options, result and errors as for `n4sid`.
    """
    return n4sid(data, order, method="moesp", **options)


def cva(data: Data, order: int | Literal["auto"] = "auto", **options: Any) -> LinearModel:
    """State-space model from the canonical variates of past and future.

    Larimore, Proc. IEEE Conf. Decision and Control 1990, in the weights of Van Overschee and De Moor, Automatica 31,
    1995: outputs of any unit and noise level count alike. Options, result and errors as for `n4sid`.
    """
    return n4sid(data, order, method="cva", **options)


def select_order(
    data: Data, method: realisation.Weighting = "n4sid", *, horizon: int | None = None, feedthrough: bool = False
) -> OrderSelection:
    """Singular values and canonical correlations of the data, and the order that they show.

    `method`: whose singular values are wanted; the order rests on the canonical correlations, which no scaling changes
    ("n4sid", "moesp" or "cva"); `feedthrough`: as for `n4sid`. Raises InputError: as for `n4sid`.
    """
    compression, future = _projected(data, "auto", horizon, feedthrough)
    return selection(method, compression, future, realisation.weighted_subspace(future, method))


def selection(method: str, compression: Compression, future: Future, subspace: realisation.Subspace) -> OrderSelection:
    """Evidence for the order in projections that are there already."""
    half = future.horizon
    correlations = future.correlations()
    past = half * (compression.inputs + compression.outputs)
    order, threshold = significant(correlations, past, half * compression.outputs, compression.windows)
    largest = min((half - 1) * compression.outputs, int(np.sum(subspace.values > 1e-10 * subspace.values[0])))
    return OrderSelection(method, half, subspace.values, correlations, threshold, min(order, largest))


def _projected(
    data: Data, order: int | Literal["auto"], horizon: int | None, feedthrough: bool, exact: bool = False
) -> tuple[Compression, Future]:
    known = None if isinstance(order, str) else order
    compression = halved_windows(data, horizon, known, feedthrough, exact)
    check_order(order, compression.length // 2, compression.outputs)
    return compression, project_future(compression)


def _better_free_run(free: LinearModel, integrating: LinearModel, experiments: Sequence[SampledData]) -> LinearModel:
    """Of a model with a very slow pole and one with an integrator in its place, that whose free run fits better."""
    errors = []
    spread = np.std(np.concatenate([one.output for one in experiments]), axis=0)
    for model in (free, integrating):
        with np.errstate(over="ignore", invalid="ignore"):
            left = [one.output - model.simulate(one) for one in experiments]
            errors.append(float(np.sum((np.concatenate(left) / spread) ** 2)))
    if not errors[1] < errors[0]:
        return free
    note = (
        "the slowest pole is an integrator: with it the free run fits the data better"
        " (--no-integrates, in Python integrates=False, leaves it as found)"
    )
    return replace(integrating, notes=(*integrating.notes, note))
