"""Parameters that the data do not determine: without influence, in combinations, or at bounds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from idloop.arrays import Array, Mask

# Eigenvalue of the unit-diagonal Hessian below which a combination of parameters is undetermined (correlation 0.9999).
_TIED = 1e-4
# Eigenvalue below which only rounding separates them.
_EXACT = 1e-8
# Relative standard error above which an undetermined combination gives a warning.
_LOOSE = 0.2
# Part of the information on a parameter, after the nuisance parameters, below which it has no influence.
_UNSEEN = 1e-8


def reduced_hessian(hessian: Array, parameters: int) -> Array:
    """Information on the first parameters of a Hessian, with the others (nuisance) unknown: the Schur complement."""
    k = parameters
    if len(hessian) == k:
        return hessian
    size = np.sqrt(np.maximum(np.diag(hessian), 1e-300))
    scaled = hessian / np.outer(size, size)
    cross = scaled[:k, k:]
    inner = np.linalg.pinv(scaled[k:, k:], rcond=1e-12, hermitian=True)
    return np.asarray((scaled[:k, :k] - cross @ inner @ cross.T) * np.outer(size[:k], size[:k]))


@dataclass(frozen=True)
class Tie:
    """Parameters of which the data determine only a combination."""

    members: tuple[int, ...]  # indices of the parameters
    exact: bool  # whether only rounding separates them


def ties(hessian: Array, parameters: int) -> tuple[list[Tie], Mask]:
    """Find parameters that the data do not determine.

    `hessian` (k + m, k + m): Gauss-Newton Hessian, parameters first; `parameters`: number k of parameters. Returns
    `ties`: combinations of two parameters or more; `seen` (k,): parameters that influence the data.
    """
    k = parameters
    reduced = reduced_hessian(hessian, k)
    raw = np.maximum(np.diag(hessian)[:k], 0.0)
    left = np.maximum(np.diag(reduced), 0.0)
    seen = (raw > 0.0) & (left > _UNSEEN * np.maximum(raw, 1e-300))
    found = []
    index = np.flatnonzero(seen)
    if len(index) > 1:
        size = np.sqrt(left[index])
        values, vectors = np.linalg.eigh(reduced[np.ix_(index, index)] / np.outer(size, size))
        for value, vector in zip(values, vectors.T, strict=True):
            if value > _TIED:
                break
            strong = np.argsort(-np.abs(vector))
            strong = strong[np.abs(vector[strong]) > 0.2][:4]
            found.append(Tie(tuple(sorted(int(index[i]) for i in strong)), bool(value < _EXACT)))
    return found, seen


def uncertainty_warnings(
    names: tuple[str, ...], values: Array, stderr: Array, tied: list[Tie], seen: Mask
) -> list[str]:
    """One warning for each parameter or combination that the data do not determine, from the result of `ties`.

    A combination with standard errors below a fifth of the values gives none.
    """
    lines = [
        f"{name} has no effect on this data; fix it or record motion that shows it"
        for name, visible in zip(names, seen, strict=True)
        if not visible
    ]
    for tie in tied:
        members = list(tie.members)
        loose = np.any(~(stderr[members] < _LOOSE * np.abs(values[members])))
        if tie.exact or loose:
            together = ", ".join(names[i] for i in members)
            lines.append(f"this data cannot tell {together} apart; fix one of them or excite differently")
    return lines


def at_bounds(values: Array, lower: Array, upper: Array, scale: Array) -> Mask:
    """Which parameters ended on a bound, shape (k,)."""
    near = 1e-9 * scale
    return np.asarray((values <= lower + near) | (values >= upper - near))
