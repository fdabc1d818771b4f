"""Curves learnt from the errors of a model, and how likely white errors would show as much."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from idloop.diagnose.curves import force_shapes
from idloop.diagnose.factors import factor_shapes
from idloop.diagnose.shape import Shape
from idloop.estimate.likelihood.parallel import in_parallel
from idloop.estimate.likelihood.unevenness import stretches

if TYPE_CHECKING:
    from idloop.diagnose.screen import Screen

Array = NDArray[np.float64]

# A height that the errors feel less than this part of the most felt one is not known.
_LEAST_FELT = 1e-3
# Directions weaker than this part of the strongest are left out.
_LEAST_WEIGHT = 1e-2


@dataclass(frozen=True)
class Learnt:
    """A shape with the heights that the errors ask for.

    Attributes
    ----------
    shape : Shape
    value, spread : array, shape (heights,)
        Heights and their standard errors.
    known : array of bool, shape (heights,)
        Which of them the errors feel.
    span : array, shape (n, directions)
        Orthonormal directions of the whitened errors that the curve reaches beside the free parameters.
    power : float
        Squared whitened errors that it explains.
    ratio : float
        The same for each direction, in the errors' variance, which may be uneven along the curve: F-distributed where
        nothing is to be learnt.
    share : float
        Share of the squared errors that it explains.
    freedom : int
        Degrees of freedom that are left.
    """

    shape: Shape
    value: Array
    spread: Array
    known: NDArray[np.bool_]
    span: Array
    power: float
    ratio: float
    share: float
    freedom: int

    @property
    def directions(self) -> int:
        """Degrees of freedom of the curve."""
        return int(self.span.shape[1])

    @property
    def merit(self) -> float:
        """Twice the log-likelihood, less what so many directions gain by chance (Akaike)."""
        return self.power - 2.0 * self.directions


def remaining(screen: Screen, level: float) -> list[Learnt]:
    """Curves that the errors follow, best first: forces, a command, coefficients that change.

    Parameters
    ----------
    screen : Screen
        Errors of the model.
    level : float
        Probability of one among white errors, of which both kinds have half.

    Returns
    -------
    list of Learnt
    """
    found = [
        one
        for shapes in (force_shapes(screen), factor_shapes(screen))
        for one, _ in significant(shapes, screen, 0.5 * level)
    ]
    return sorted(found, key=lambda one: -one.merit)


def significant(shapes: Sequence[Shape], screen: Screen, level: float) -> list[tuple[Learnt, float]]:
    """Shapes that the errors follow, best first, each with its p-value for the best of all that were tried.

    Parameters
    ----------
    shapes : sequence of Shape
    screen : Screen
        Errors of the model.
    level : float
        Probability of one among white errors.

    Returns
    -------
    list of tuple
    """
    from scipy.stats import f as f_distribution

    fits = [fit for fit in in_parallel(partial(learn, screen), shapes) if fit is not None]

    def chance(fit: Learnt) -> float:
        return float(f_distribution.sf(fit.ratio, fit.directions, fit.freedom)) * len(fits) * fit.shape.tried

    found = [(fit, p_value) for fit in fits if (p_value := chance(fit)) < level]
    return sorted(found, key=lambda pair: -pair[0].merit)


def learn(screen: Screen, shape: Shape) -> Learnt | None:
    """Least squares of a curve's heights on the errors, with what the free parameters do projected out.

    Parameters
    ----------
    screen : Screen
    shape : Shape

    Returns
    -------
    Learnt or None
        None where the curve cannot be simulated, or the errors do not feel it.
    """
    columns = [shape.change(hat) for hat in shape.hats()]
    if any(column is None for column in columns):
        return None
    raw = np.column_stack([column for column in columns if column is not None])
    own, errors = raw - screen.basis @ (screen.basis.T @ raw), screen.errors
    if shape.coefficient:
        # That it is another constant everywhere is for an effect of the catalogue, or the free parameter, to say.
        level = np.sum(own, axis=1)
        level /= max(float(np.linalg.norm(level)), 1e-300)
        own, errors = own - np.outer(level, level @ own), errors - level * float(level @ errors)
    size = np.linalg.norm(own, axis=0)
    known = size > _LEAST_FELT * max(float(np.max(size)), 1e-300)
    if not np.any(known):
        return None
    left, weight, right = np.linalg.svd(own[:, known] / size[known], full_matrices=False)
    kept = weight > _LEAST_WEIGHT * weight[0]
    left, weight, right = left[:, kept], weight[kept], right[kept]
    scores = -(left.T @ errors)
    rest = errors + left @ scores
    freedom = max(len(rest) - len(scores) - screen.basis.shape[1], 1)
    variance = float(rest @ rest) / freedom
    # Uneven variance along the curve makes it look surer than it is.
    meat = (left * rest[:, None] ** 2).T @ left
    sums = np.add.reduceat(left * rest[:, None], stretches(len(rest)), axis=0)
    uneven = max(1.0, *(float(np.max(np.linalg.eigvalsh(m))) / variance for m in (meat, sums.T @ sums)))
    solve = (right.T / weight) / size[known][:, None] * shape.step
    value, spread = np.zeros(len(known)), np.zeros(len(known))
    value[known] = solve @ scores
    spread[known] = np.sqrt(np.sum(solve**2, axis=1) * variance * uneven)
    power = float(scores @ scores)
    return Learnt(
        shape=shape,
        value=value,
        spread=spread,
        known=known,
        span=np.ascontiguousarray(left),
        power=power,
        ratio=power / len(scores) / (variance * uneven),
        share=power / max(float(screen.errors @ screen.errors), 1e-300),
        freedom=freedom,
    )
