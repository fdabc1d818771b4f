"""Inertial parameters of a link that some distribution of positive mass has.

The pseudo-inertia J = [[Σ, h], [hᵀ, m]], Σ = ½ tr(I) 1 − I, is positive definite exactly where a mass density produces
the ten parameters (Traversaro et al., IROS 2016; Wensing, Kim and Slotine, IEEE Robotics and Automation Letters 3,
2018).
J = U Uᵀ with an upper triangular U of positive diagonal has no constraint left (Rucker and Wensing, IEEE Robotics and
Automation Letters 7, 2022). Here U = U₀ V with U₀ of the description, so that V = 1 is the description itself, and the
entries of V are numbers without units.
"""

from __future__ import annotations

import numpy as np

from idloop.arrays import Array

_DIAGONAL = np.arange(4)
_UPPER = np.triu_indices(4, 1)
# A link without an inertia in the description: a ball of this mass [kg] and radius [m].
_BALL = (0.1, 0.03)
# Eigenvalues of a pseudo-inertia below this part of its largest in each block count as none.
_FLAT = 1e-3


def pseudo_inertia(parameters: Array) -> Array:
    """Pseudo-inertia (4, 4) of ten parameters: mass, first moments, inertia (xx, xy, yy, xz, yz, zz)."""
    m, hx, hy, hz, xx, xy, yy, xz, yz, zz = parameters
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    first = np.array([[hx], [hy], [hz]])
    return np.block([[0.5 * np.trace(inertia) * np.eye(3) - inertia, first], [first.T, np.array([[m]])]])


def parameters_of(pseudo: Array) -> Array:
    """Ten parameters of pseudo-inertias (..., 4, 4), shape (..., 10)."""
    second = pseudo[..., :3, :3]
    trace = np.trace(second, axis1=-2, axis2=-1)[..., None, None]
    inertia = trace * np.eye(3) - second
    return np.stack(
        [
            pseudo[..., 3, 3], pseudo[..., 0, 3], pseudo[..., 1, 3], pseudo[..., 2, 3],
            inertia[..., 0, 0], inertia[..., 0, 1], inertia[..., 1, 1],
            inertia[..., 0, 2], inertia[..., 1, 2], inertia[..., 2, 2],
        ],
        axis=-1,
    )  # fmt: skip


def nearest_consistent(parameters: Array) -> Array:
    """Ten parameters with positive mass and with an extent in every direction, near the given ones."""
    mass = float(parameters[0])
    if not mass > 0.0:
        mass, radius = _BALL
        inertia = 0.4 * mass * radius**2
        return np.array([mass, 0.0, 0.0, 0.0, inertia, 0.0, inertia, 0.0, 0.0, inertia])
    first = parameters[1:4] / mass
    pseudo = pseudo_inertia(parameters)
    about_centre = pseudo[:3, :3] - mass * np.outer(first, first)
    values, axes = np.linalg.eigh(0.5 * (about_centre + about_centre.T))
    # A point mass, or a description in which the triangle inequality fails.
    floor = max(_FLAT * float(values[-1]), _FLAT * mass * _BALL[1] ** 2)
    second = axes @ np.diag(np.maximum(values, floor)) @ axes.T
    pseudo[:3, :3] = second + mass * np.outer(first, first)
    return parameters_of(pseudo)


def root_of(parameters: Array) -> Array:
    """Upper triangular U (4, 4) of positive diagonal with U Uᵀ the pseudo-inertia of ten consistent parameters."""
    turned = np.linalg.cholesky(pseudo_inertia(parameters)[::-1, ::-1])
    return np.asarray(turned[::-1, ::-1])


def parameters_at(roots: Array, coordinates: Array) -> Array:
    """Ten parameters of each link.

    `roots` (links, 4, 4): from `root_of`, of the description. `coordinates` (links, 10): logarithms of the diagonal of
    V, and its entries above the diagonal; zero for the description. Returns shape (links, 10).
    """
    change = np.zeros((len(roots), 4, 4))
    change[:, _DIAGONAL, _DIAGONAL] = np.exp(coordinates[:, :4])
    change[:, _UPPER[0], _UPPER[1]] = coordinates[:, 4:]
    root = roots @ change
    return parameters_of(root @ np.swapaxes(root, -1, -2))
