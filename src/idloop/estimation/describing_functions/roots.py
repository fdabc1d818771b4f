"""Zeros of a complex function of two real variables, from its values on a grid."""

from __future__ import annotations

import numpy as np

from idloop.estimation.describing_functions.harmonics import Complexes, Floats

# A zero on an edge belongs to both triangles: better found twice than never.
_EDGE = 1e-9


def grid_roots(value: Complexes) -> Floats:
    """Zeros of the function that is linear on each half of every cell of a grid.

    `value` (m, k): values at the grid's points; cells with a value that is not finite hold no zero. Returns shape (r,
    2): fractional row and column of each zero; one on an edge may appear twice.
    """
    if min(value.shape) < 2:
        return np.zeros((0, 2))
    low, right, up, far = value[:-1, :-1], value[:-1, 1:], value[1:, :-1], value[1:, 1:]
    first, second = _triangle(low, up, right), _triangle(far, right, up)
    found = [np.zeros((0, 2))]
    for (rows, columns, s, t), sign, origin in ((first, 1.0, 0), (second, -1.0, 1)):
        found.append(np.column_stack([rows + origin + sign * s, columns + origin + sign * t]))
    return np.concatenate(found)


def _triangle(corner: Complexes, row: Complexes, column: Complexes) -> tuple[Floats, Floats, Floats, Floats]:
    """Cells whose triangle holds 0, and how far along the row and the column it lies there."""
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        along, across = row - corner, column - corner
        area = along.real * across.imag - along.imag * across.real
        s = (across.real * corner.imag - across.imag * corner.real) / area
        t = (along.imag * corner.real - along.real * corner.imag) / area
        inside = (s >= -_EDGE) & (t >= -_EDGE) & (s + t <= 1.0 + 2.0 * _EDGE)
    rows, columns = np.nonzero(inside)
    return rows.astype(float), columns.astype(float), s[inside], t[inside]
