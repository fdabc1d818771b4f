"""ARX models by least squares: A(q) y = sum_i B_i(q) u_i + e."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from idloop.arrays import Array
from idloop.errors import InputError
from idloop.estimation.black_box.prefilter import Filter, prefiltered
from idloop.estimation.black_box.sampled import SampledData, together
from idloop.estimation.polynomial.model import PolynomialModel, assemble
from idloop.estimation.polynomial.polynomials import Orders, Polynomials, Realization, matrix_form
from idloop.estimation.polynomial.regression import (
    Errors,
    Focus,
    Initial,
    channels,
    check_inputs,
    coloured_errors,
    first_row,
    least_squares,
    open_note,
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
    coupled: bool = False,
    focus: Focus = "prediction",
    prefilter: Filter | None = None,
    initial: Initial = "estimate",
    errors: Errors = "coloured",
) -> PolynomialModel:
    """Estimate A(q) y = sum_i B_i(q) u_i + e by QR least squares.

    Each output gets a model of its own unless they are coupled. Signals count as deviations from rest: remove
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
    coupled : bool
        ARX with matrices: each output is also regressed on the past `na` samples of the others.
    focus : "prediction" or "simulation"
        What is minimised: the error one sample ahead, or that of the free run (then by search).
    prefilter : (numerator, denominator) or discrete python-control system, optional
        Filter that weighs frequencies; the noise model is then one of the filtered signals.
    initial : "estimate" or "zero"
        Whether fits begin where the past is known, or the signals were zero before the record.
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
    m, p = experiments[0].input.shape[1], experiments[0].output.shape[1]
    orders = Orders.of(m, na=na, nb=nb, nk=nk)
    check_inputs(experiments, orders)
    if focus == "simulation":
        if coupled:
            raise InputError("arx: focus 'simulation' is for uncoupled outputs; leave coupled out")
        from idloop.estimation.polynomial.prediction_error import search

        numbers = {"na": na, "nb": nb, "nk": nk}
        return search("arx", experiments, numbers, focus=focus, prefilter=prefilter, initial=initial, errors=errors)
    if coupled and p > 1:
        orders = Orders.of(m + p - 1, na=na, nb=orders.nb + (na,) * (p - 1), nk=orders.nk + (1,) * (p - 1))
    weighted = prefiltered(experiments, prefilter)
    first = first_row(orders, initial)
    found, left, notes = [], [], []
    for column, name in enumerate(experiments[0].output_names):
        signals = channels(weighted, column, coupled)
        solution = least_squares(signals, orders, initial)
        own = channels(experiments, column, coupled) if prefilter is not None else signals
        residuals = [residual_of(c, orders, solution.coefficients, first) for c in own]
        rows = sum(len(c.output) - first for c in signals)
        degrees = max(rows - orders.size, 1)
        if errors == "white":
            covariance = white_errors(solution.factor, solution.squares / degrees, solution.undetermined)
        else:
            scores = [scores_of(c, orders, solution, first) for c in signals]
            covariance = coloured_errors(solution.factor, scores, orders.size, solution.undetermined)
        others = tuple(n for n in experiments[0].output_names if coupled and n != name)
        polynomials = Polynomials.from_vector(
            orders, solution.coefficients, sample_time=experiments[0].sample_time,
            input_names=experiments[0].input_names + others, output_name=name,
            variance=_mean_square(residuals), covariance=covariance,
        )  # fmt: skip
        found.append(polynomials)
        left.append(residuals)
        notes += open_note(polynomials, solution.undetermined)
    form = _matrices(found, m) if coupled and p > 1 else None
    return assemble("arx", experiments, found, left, notes=notes, realization=form)


def _mean_square(residuals: Sequence[Array]) -> float:
    return float(sum(r @ r for r in residuals) / max(sum(map(len, residuals)), 1))


def _matrices(polynomials: Sequence[Polynomials], inputs: int) -> Realization:
    """State space of coupled outputs, each with the others as its last inputs."""
    p, na = len(polynomials), len(polynomials[0].a) - 1
    reach = max([len(polynomials[0].numerator(i)) for i in range(inputs)] + [1])
    a, b = np.zeros((na, p, p)), np.zeros((reach, p, inputs))
    for row, one in enumerate(polynomials):
        a[:, row, row] = one.a[1:]
        others = [column for column in range(p) if column != row]
        for index, column in enumerate(others):
            a[:, row, column] = -one.b[inputs + index]
        for i in range(inputs):
            numerator = one.numerator(i)
            b[: len(numerator), row, i] = numerator
    return matrix_form(a, b)
