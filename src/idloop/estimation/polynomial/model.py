"""Polynomial models of all outputs as one state-space model."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from idloop.arrays import Array, Mask
from idloop.estimation.black_box.prefilter import Filter, prefiltered
from idloop.estimation.black_box.sampled import SampledData
from idloop.estimation.linear import Coefficient, LinearModel
from idloop.estimation.linear.least_squares import rows_in_blocks, triangle
from idloop.estimation.linear.model import instability_notes
from idloop.estimation.polynomial.polynomials import Orders, Polynomials, stack
from idloop.estimation.polynomial.regression import Channel, channels, check_inputs, lagged, open_note
from idloop.estimation.statistics.collinear import collinear_inputs, collinearity_notes

_ROUNDING = 1e-9  # a direction of the windows of less than this part of the largest is none
_FIRST_LOOK = 20_000  # samples that are nearly always enough


def excited_order(commands: Sequence[Array], most: int) -> int:
    """Order of which a command is persistently exciting (Ljung, 2nd ed., definition 13.1), `most` or less."""
    for few in (True, False):
        used = [command[:_FIRST_LOOK] if few else command for command in commands]
        blocks = [
            lagged(command, range(most), start, stop)
            for command in used
            for start, stop in rows_in_blocks(len(command), most - 1)
        ]
        if not blocks:
            return 0
        sizes = np.linalg.svd(triangle(blocks), compute_uv=False)
        order = int(np.sum(sizes > _ROUNDING * sizes[0]))
        if order == most or max(map(len, commands)) <= _FIRST_LOOK:
            break
    return order


def excitation_notes(
    data: Sequence[SampledData], polynomials: Sequence[Polynomials], instruments: bool = False
) -> list[str]:
    """One note for each command that does not excite B and F sufficiently (Ljung, 2nd ed., section 13.4).

    Outputs excite A by their noise, whatever the command is.
    """
    notes = []
    for column, name in enumerate(data[0].input_names):
        used = [p.orders for p in polynomials if p.orders.nb[column]]
        needed = max((o.nb[column] + o.nf[column] + (o.na if instruments else 0) for o in used), default=0)
        if needed == 0:
            continue
        order = excited_order([one.input[:, column] for one in data], needed)
        if order < needed:
            kind = {1: ", as a constant is", 2: ", as a single sine is"}.get(order, "")
            notes.append(
                f"{name} is persistently exciting of order {order} only{kind}, and its polynomials need {needed}: their"
                " coefficients are chance; excite more frequencies or lower the orders"
            )
    return notes


@dataclass(frozen=True, eq=False)
class PolynomialModel(LinearModel):
    """Linear model with the polynomials that it was estimated as."""

    # one per output
    polynomials: tuple[Polynomials, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers for JSON."""
        return super().to_dict() | {"polynomials": [p.to_dict() for p in self.polynomials]}


class Fitted(NamedTuple):
    """Coefficients of one output's model."""

    vector: Array  # shape (k,)
    covariance: Array  # shape (k, k)
    undetermined: Mask  # shape (k,): which coefficients the data leave open
    residuals: list[Array]  # prediction errors of each experiment, up to its end
    variance: float | None = None  # of the innovations; that of the residuals where not given
    notes: Sequence[str] = ()


def fit_outputs(
    method: str,
    data: Sequence[SampledData],
    orders: Orders,
    prefilter: Filter | None,
    fit: Callable[[list[Channel], list[Channel], int], Fitted],
) -> PolynomialModel:
    """Fit each output and put them together; `fit` gets the filtered and the measured signals, and the output."""
    check_inputs(data, orders)
    weighted, first = prefiltered(data, prefilter), data[0]
    found, left, notes = [], [], []
    for column, name in enumerate(first.output_names):
        one = fit(channels(weighted, column), channels(data, column), column)
        squares = sum(float(r @ r) for r in one.residuals) / max(sum(map(len, one.residuals)), 1)
        polynomials = Polynomials.from_vector(
            orders, one.vector, sample_time=first.sample_time, input_names=first.input_names, output_name=name,
            variance=squares if one.variance is None else one.variance, covariance=one.covariance,
        )  # fmt: skip
        found.append(polynomials)
        left.append(one.residuals)
        notes += [*open_note(polynomials, one.undetermined), *one.notes]
    return assemble(method, data, found, left, notes=notes)


def assemble(
    method: str,
    data: Sequence[SampledData],
    polynomials: Sequence[Polynomials],
    errors: Sequence[Sequence[Array]],
    *,
    notes: Sequence[str] = (),
) -> PolynomialModel:
    """Put the outputs' polynomials together to one model."""
    from scipy.linalg import block_diag

    common = [
        np.column_stack([part[len(part) - min(map(len, parts)) :] for part in parts])
        for parts in zip(*errors, strict=True)
    ]
    innovations = np.vstack(common)
    polynomials = _without_chance(polynomials, collinear_inputs(np.vstack([one.input for one in data])))
    form = stack([p.realization for p in polynomials])
    prefix = [f"{p.output_name}." if len(polynomials) > 1 else "" for p in polynomials]
    coefficients = tuple(
        Coefficient(before + c.name, c.value, c.stderr)
        for before, p in zip(prefix, polynomials, strict=True)
        for c in p.coefficients
    )
    known = [p.covariance for p in polynomials if p.covariance is not None]
    first = data[0]
    model = PolynomialModel(
        method=method, a=form.a, b=form.b, c=form.c, d=form.d, gain=form.gain,
        covariance=innovations.T @ innovations / len(innovations),
        sample_time=first.sample_time,
        input_names=first.input_names, input_units=first.input_units,
        output_names=first.output_names, output_units=first.output_units,
        samples=len(innovations), free=len(coefficients), coefficients=coefficients,
        # Between outputs the errors may correlate, which leaves each output's own block as it is.
        coefficient_covariance=block_diag(*known) if len(known) == len(polynomials) else None,
        notes=(
            *dict.fromkeys(notes), *excitation_notes(data, polynomials, method == "iv4"), *instability_notes(form.a),
        ),
        polynomials=tuple(polynomials),
    )  # fmt: skip
    return replace(model, notes=(*model.notes, *collinearity_notes(data, model)))


def _without_chance(polynomials: Sequence[Polynomials], together: Mask) -> Sequence[Polynomials]:
    """Polynomials without standard errors of inputs that are combinations of each other.

    A search that ends at one of many equivalent solutions gives the curvature there only.
    """
    found = []
    for one in polynomials:
        covariance = None if one.covariance is None else one.covariance.copy()
        for index in np.flatnonzero(together):
            for place in (one.orders.b(int(index)), one.orders.f(int(index))):
                if covariance is not None:
                    covariance[place, :] = covariance[:, place] = np.nan
        found.append(replace(one, covariance=covariance))
    return found
