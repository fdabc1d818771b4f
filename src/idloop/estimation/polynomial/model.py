"""A linear model that was estimated as polynomials."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from idloop.estimation.black_box.sampled import SampledData
from idloop.estimation.linear import Coefficient, LinearModel
from idloop.estimation.linear.instability import instability_notes
from idloop.estimation.polynomial.excitation import excitation_notes
from idloop.estimation.polynomial.polynomials import Polynomials
from idloop.estimation.polynomial.realization import Realization, stack
from idloop.estimation.statistics.collinear import moving_together, together_notes

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PolynomialModel(LinearModel):
    """Linear model with the polynomials that it was estimated as.

    Attributes
    ----------
    polynomials : tuple of Polynomials, one per output
        Of a coupled ARX model those of an output have the other outputs as further inputs.
    """

    polynomials: tuple[Polynomials, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers for JSON."""
        return super().to_dict() | {"polynomials": [p.to_dict() for p in self.polynomials]}


def assemble(
    method: str,
    data: Sequence[SampledData],
    polynomials: Sequence[Polynomials],
    errors: Sequence[Sequence[Array]],
    *,
    notes: Sequence[str] = (),
    realization: Realization | None = None,
) -> PolynomialModel:
    """Put the outputs' polynomials together to one model.

    `polynomials`: of each output; `errors`: prediction errors of each output in each experiment, up to its end;
    `realization`: by default that of the polynomials side by side.
    """
    from scipy.linalg import block_diag

    common = [
        np.column_stack([part[len(part) - min(map(len, parts)) :] for part in parts])
        for parts in zip(*errors, strict=True)
    ]
    innovations = np.vstack(common)
    polynomials = _without_chance(polynomials, moving_together(np.vstack([one.input for one in data])))
    form = stack([p.realization for p in polynomials]) if realization is None else realization
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
    return replace(model, notes=(*model.notes, *together_notes(data, model)))


def _without_chance(polynomials: Sequence[Polynomials], together: NDArray[np.bool_]) -> Sequence[Polynomials]:
    """Polynomials without standard errors of inputs that are combinations of each other.

    A search that ends at one of the many equal choices sees the curvature there only.
    """
    if not np.any(together):
        return polynomials
    found = []
    for one in polynomials:
        if one.covariance is not None:
            covariance = one.covariance.copy()
            for index in np.flatnonzero(together):
                for place in (one.orders.b(int(index)), one.orders.f(int(index))):
                    covariance[place, :] = np.nan
                    covariance[:, place] = np.nan
            found.append(replace(one, covariance=covariance))
        else:
            found.append(one)
    return found
