"""ARX models by least squares: A(q) y = sum_i B_i(q) u_i + e."""

from __future__ import annotations

from collections.abc import Sequence

from idloop.estimation.black_box.prefilter import Filter
from idloop.estimation.black_box.sampled import SampledData, together
from idloop.estimation.polynomial.model import Fitted, PolynomialModel, fit_outputs
from idloop.estimation.polynomial.polynomials import Orders
from idloop.estimation.polynomial.regression import (
    Channel,
    Errors,
    Focus,
    coloured_errors,
    first_row,
    least_squares,
    residual_of,
    scores_of,
    white_errors,
)


def arx(
    data: SampledData | Sequence[SampledData],
    na: int,
    nb: int | Sequence[int],
    nk: int | Sequence[int] = 1,
    *,
    focus: Focus = "prediction",
    prefilter: Filter | None = None,
    errors: Errors = "coloured",
) -> PolynomialModel:
    """Estimate A(q) y = sum_i B_i(q) u_i + e by QR least squares.

    Each output gets a model of its own. Signals count as deviations from rest: remove
    offsets first. The estimate is consistent when e is white;
    in other noise B / A is biased towards where the noise model 1 / A fits, which `iv4` avoids.

    Parameters
    ----------
    data : SampledData or sequence of SampledData
        Experiments, each with a past of its own.
    na : int
        Degree of A.
    nb, nk : int or one per input
        Number of coefficients of B and lag of the first [samples]; 1 is the delay of a sampled plant.
    focus : "prediction" or "simulation"
        What is minimised: the error one sample ahead, or that of the free run (then by search).
    prefilter : (numerator, denominator) or discrete python-control system, optional
        Filter that weighs frequencies; the noise model is then one of the filtered signals.
    errors : "coloured" or "white"
        Standard errors that hold for too poor a model as well (sandwich), or the classical ones.

    Raises
    ------
    InputError
        Orders that do not suit the signals, too few samples, or an input that never moves.

    References
    ----------
    Ljung, System Identification, 2nd ed., sections 4.2, 7.3, 9.2, 10.1.
    """
    experiments = together(data)
    orders = Orders.of(experiments[0].input.shape[1], na=na, nb=nb, nk=nk)
    if focus == "simulation":
        from idloop.estimation.polynomial.prediction_error import search

        numbers = {"na": na, "nb": nb, "nk": nk}
        return search("arx", experiments, numbers, focus=focus, prefilter=prefilter, errors=errors)
    first = first_row(orders)

    def fit(weighted: list[Channel], measured: list[Channel], _: int) -> Fitted:
        solution = least_squares(weighted, orders)
        rows = sum(len(c.output) - first for c in weighted)
        if errors == "white":
            variance = solution.squares / max(rows - orders.size, 1)
            covariance = white_errors(solution.factor, variance, solution.undetermined)
        else:
            scores = [scores_of(c, orders, solution, first) for c in weighted]
            covariance = coloured_errors(solution.factor, scores, orders.size, solution.undetermined)
        residuals = [residual_of(c, orders, solution.coefficients, first) for c in measured]
        return Fitted(solution.coefficients, covariance, solution.undetermined, residuals)

    return fit_outputs("arx", experiments, orders, prefilter, fit)
