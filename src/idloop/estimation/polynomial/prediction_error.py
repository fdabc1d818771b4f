"""Prediction-error estimates of ARMAX, output-error and Box-Jenkins models."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from idloop.arrays import Array, Mask
from idloop.errors import InputError
from idloop.estimation.black_box.prefilter import Filter
from idloop.estimation.black_box.sampled import SampledData, together
from idloop.estimation.polynomial.instruments import refined
from idloop.estimation.polynomial.model import Fitted, PolynomialModel, fit_outputs
from idloop.estimation.polynomial.polynomials import Orders, radius, reflect
from idloop.estimation.polynomial.regression import Channel, Errors, Focus, coloured_errors, white_errors
from idloop.estimation.polynomial.search import Found, Objective, best, information
from idloop.estimation.polynomial.start import noise_start, shared_denominator, starts

_EDGE = 1e-3  # roots of C this close to the unit circle are on it
_START_ROWS = 100_000  # a start needs no more samples than this


def armax(
    data: SampledData | Sequence[SampledData],
    na: int,
    nb: int | Sequence[int],
    nc: int,
    nk: int | Sequence[int] = 1,
    *,
    focus: Focus = "prediction",
    prefilter: Filter | None = None,
    errors: Errors | None = None,
) -> PolynomialModel:
    """Estimate A(q) y = sum_i B_i(q) u_i + C(q) e: disturbances that enter where the command does.

    Each output gets a model of its own. The search starts from several linear estimates and keeps the lowest
    minimum; predictors that run away are left out. Signals count as deviations from rest: remove offsets first.

    Parameters
    ----------
    data : SampledData or sequence of SampledData
        Experiments, each with initial conditions of its own.
    na, nc : int
        Degrees of A and C (and D, nd).
    nb, nk : int or one per input
        Number of coefficients of B (and degree of F, nf), lag of the first coefficient of B [samples].
    focus : "prediction" or "simulation"
        What the plant is fitted to: the error one sample ahead, or that of the free run; in the latter case the
        noise model is fitted to what the plant leaves.
    prefilter : (numerator, denominator) or discrete python-control system, optional
        Filter that weighs frequencies; the noise model is then one of the filtered signals.
    errors : "white" or "coloured", optional
        Standard errors by Ljung's asymptotics for white innovations, or by a sandwich that holds for a noise
        model that is too poor as well; by default white where prediction is what was fitted.

    Raises
    ------
    InputError
        Orders that do not suit the signals, or too few samples.

    References
    ----------
    Ljung, System Identification, 2nd ed., sections 4.2, 7.2, 9.3, 10.2 and 10.5.
    """
    orders = {"na": na, "nb": nb, "nc": nc, "nk": nk}
    return search("armax", data, orders, focus=focus, prefilter=prefilter, errors=errors)


def output_error(
    data: SampledData | Sequence[SampledData],
    nb: int | Sequence[int],
    nf: int | Sequence[int],
    nk: int | Sequence[int] = 1,
    *,
    prefilter: Filter | None = None,
    errors: Errors | None = "coloured",
) -> PolynomialModel:
    """Estimate y = sum_i B_i(q) / F_i(q) u_i + e: the model of the best free run.

    Consistent in noise of any colour in open loop; in closed loop only in white noise (Ljung, System Identification,
    2nd ed., eq. 4.25, section 8.4). Parameters, result and errors as for `armax`.
    """
    orders = {"nb": nb, "nf": nf, "nk": nk}
    errors = errors or "coloured"
    return search("oe", data, orders, focus="prediction", prefilter=prefilter, errors=errors)


def box_jenkins(
    data: SampledData | Sequence[SampledData],
    nb: int | Sequence[int],
    nc: int,
    nd: int,
    nf: int | Sequence[int],
    nk: int | Sequence[int] = 1,
    *,
    focus: Focus = "prediction",
    prefilter: Filter | None = None,
    errors: Errors | None = None,
) -> PolynomialModel:
    """Estimate y = sum_i B_i(q) / F_i(q) u_i + C(q) / D(q) e: plant and noise have no polynomial in common.

    Ljung, System Identification, 2nd ed., eq. 4.31. Parameters, result and errors as for `armax`.
    """
    orders = {"nb": nb, "nc": nc, "nd": nd, "nf": nf, "nk": nk}
    return search("bj", data, orders, focus=focus, prefilter=prefilter, errors=errors)


def search(
    method: str,
    data: SampledData | Sequence[SampledData],
    degrees: Mapping[str, Any],
    *,
    focus: Focus,
    prefilter: Filter | None,
    errors: Errors | None,
) -> PolynomialModel:
    """Fit each output and put the outputs together; `degrees` as for `Orders.of`, the rest as `armax`."""
    experiments = together(data)
    orders = Orders.of(experiments[0].input.shape[1], **degrees)
    kind: Errors = errors or ("white" if focus == "prediction" and prefilter is None else "coloured")
    fitted = _predicting if focus == "prediction" else _simulating

    def fit(weighted: list[Channel], measured: list[Channel], column: int) -> Fitted:
        vector, covariance, undetermined, converged = fitted(weighted, orders, kind)
        objective = Objective(measured, orders)
        residuals = objective.errors(vector)
        if not all(np.all(np.isfinite(r)) for r in residuals):
            residuals = Objective(measured, orders, integrating=True).errors(vector)
        notes = _search_notes(experiments[0].output_names[column], orders, vector, objective.plant_limit, converged)
        return Fitted(vector, covariance, undetermined, residuals, notes=notes)

    return fit_outputs(method, experiments, orders, prefilter, fit)


def _search_notes(name: str, orders: Orders, vector: Array, limit: float, converged: bool) -> list[str]:
    """Notes on roots at the edge of what the search allows, and on a search that did not converge."""
    notes = []
    outermost = max((radius(np.append(1.0, vector[orders.f(i)])) for i in range(orders.inputs)), default=0.0)
    if outermost > 1.0 + 0.9 * (limit - 1.0):
        notes.append(
            f"{name}: F is held at {outermost:.4g}, the farthest out that errors of its free run stay small;"
            " an unstable plant needs armax, arx or a state-space method"
        )
    if radius(np.append(1.0, vector[orders.c])) > 1.0 - _EDGE:
        notes.append(
            f"{name}: C has a root on the unit circle, where standard errors do not hold;"
            " the noise needs fewer coefficients, or the data have a trend or were differenced"
        )
    elif not converged:
        notes.append(f"{name}: the search stopped before it converged; try lower orders or more data")
    return notes


_Fitted = tuple[Array, Array, Mask, bool]


def _predicting(data: Sequence[Channel], orders: Orders, errors: Errors) -> _Fitted:
    objective = Objective(data, orders)
    _enough(objective)
    found = best(objective, starts(_beginning(data), orders))
    covariance, undetermined = _covariance(objective, found, errors)
    return found.free, covariance, undetermined, found.converged


def _simulating(data: Sequence[Channel], orders: Orders, errors: Errors) -> _Fitted:
    """Plant from the free run, then the noise model from what it leaves."""
    if orders.na:
        # With C tied to A the error one step ahead is that of the free run.
        plant = Orders(orders.na, orders.nb, orders.na, 0, orders.nf, orders.nk)
        spread = np.zeros((plant.size, orders.na + sum(orders.nb)))
        spread[: spread.shape[1]] = np.eye(spread.shape[1])
        spread[plant.c, plant.a] = np.eye(orders.na)
        single = Orders(orders.na, orders.nb, 0, 0, orders.nf, orders.nk)
        beginning = _beginning(data)
        points = shared_denominator(beginning, single)
        points.append(refined(beginning, single, points[-1]))
        objective = Objective(data, plant, spread, integrating=True)
    else:
        plant = Orders(0, orders.nb, 0, 0, orders.nf, orders.nk)
        points = starts(_beginning(data), plant)
        objective = Objective(data, plant)
    _enough(objective)
    found = best(objective, points)
    vector, covariance = np.zeros(orders.size), np.zeros((orders.size, orders.size))
    open_ = np.zeros(orders.size, dtype=bool)
    own = [*range(orders.na + sum(orders.nb)), *range(orders.d.stop, orders.size)]
    noise = [*range(orders.c.start, orders.d.stop)]
    vector[own] = found.free
    block, open_[own] = _covariance(objective, found, errors)
    covariance[np.ix_(own, own)] = block
    converged = found.converged
    if noise:
        series = Objective(data, Orders(orders.na, orders.nb, 0, 0, orders.nf, orders.nk), integrating=True).errors(
            vector[own]
        )
        begin = noise_start(series, orders.nc, orders.nd)
        vector[noise] = begin
        known = vector.copy()
        known[noise] = 0.0
        rest = Objective(data, orders, np.eye(orders.size)[:, noise], known)
        # C starts with its roots well inside the unit circle.
        safe = np.append(reflect(np.append(1.0, begin[: orders.nc]), 0.98)[1:], begin[orders.nc :])
        second = best(rest, [safe, np.zeros(len(noise))])
        vector[noise] = second.free
        block, open_[noise] = _covariance(rest, second, errors)
        covariance[np.ix_(noise, noise)] = block
        converged = converged and second.converged
    return vector, covariance, open_, converged


def _covariance(objective: Objective, found: Found, errors: Errors) -> tuple[Array, Mask]:
    known = information(objective, found.free)
    parameters = len(found.free) + objective.past
    if errors == "white":
        variance = found.squares / max(objective.rows - parameters, 1)
        return white_errors(known.factor, variance, known.undetermined), known.undetermined
    return coloured_errors(known.factor, known.scores, parameters, known.undetermined), known.undetermined


def _enough(objective: Objective) -> None:
    needed = objective.spread.shape[1] + objective.past
    if objective.rows <= needed:
        raise InputError(
            f"{objective.rows} usable samples for {needed} coefficients and initial conditions;"
            " record longer or lower the orders"
        )


def _beginning(data: Sequence[Channel]) -> list[Channel]:
    """At most so much of each experiment as a start needs."""
    share = _START_ROWS / max(sum(len(c.output) for c in data), _START_ROWS)
    cut = [int(np.ceil(share * len(c.output))) for c in data]
    return [Channel(c.output[:n], c.inputs[:n]) for c, n in zip(data, cut, strict=True)]
