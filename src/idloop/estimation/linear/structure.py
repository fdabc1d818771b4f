"""Prediction error method on a structure of the user's own: matrices as a function of a few parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from idloop.arrays import Array
from idloop.errors import InputError
from idloop.estimation.black_box.sampled import SampledData
from idloop.estimation.linear.model import Focus, LinearModel
from idloop.estimation.linear.prediction_error import filtered, finished, overflowing
from idloop.estimation.linear.search import Parametrisation, search
from idloop.estimation.linear.sensitivity import Matrices

if TYPE_CHECKING:
    from idloop.estimation.black_box.prefilter import Filter

Structure = Callable[..., tuple[ArrayLike, ...]]

_STEP = 6e-6  # relative step of the central differences of the matrices: the cube root of the rounding


def fit_structure(
    data: SampledData | Sequence[SampledData],
    structure: Structure,
    start: Mapping[str, float],
    *,
    continuous: bool = False,
    focus: Focus = "prediction",
    prefilter: Filter | None = None,
    initial: bool = True,
    max_iterations: int = 100,
) -> LinearModel:
    """Estimate the parameters of a linear structure, as "idgrey" models are.

    Parameters
    ----------
    data : SampledData or sequence of SampledData
        Experiments of one system; offsets removed.
    structure : callable
        Parameters by keyword to (A, B, C, D) or (A, B, C, D, K), as arrays. Without K the errors are those of the
        free run.
    start : mapping of str to float
        Parameters to start from.
    continuous : bool
        Whether A, B and K are those of differential equations [1/s]: commands, and innovations with them, are then
        held from sample to sample.
    focus, prefilter, initial, max_iterations
        As for `prediction_error`.

    Returns
    -------
    LinearModel
        Method "structure", discrete, with the parameters as coefficients.

    Raises
    ------
    InputError
        Matrices whose shapes do not suit each other or the data, or errors at the start that overflow.
    """
    experiments = filtered(data, prefilter)
    if not start:
        raise InputError("no parameters to estimate; give the structure at least one")
    first = experiments[0]
    names = tuple(start)
    m, p = first.input.shape[1], first.output.shape[1]

    def build(point: Array) -> Matrices:
        given = structure(**dict(zip(names, (float(value) for value in point), strict=True)))
        matrices = _matrices(given, m, p)
        if focus == "simulation":
            matrices = Matrices(matrices.a, matrices.b, matrices.c, matrices.d, np.zeros_like(matrices.gain))
        return _held(matrices, first.sample_time) if continuous else matrices

    def slope(point: Array) -> Array:
        columns = []
        for index, value in enumerate(point):
            step = _STEP * (abs(value) or 1.0)
            move = np.zeros(len(point))
            move[index] = step
            columns.append((build(point + move).flat() - build(point - move).flat()) / (2.0 * step))
        return np.stack(columns, axis=1)

    with_gain = focus == "prediction" and len(structure(**start)) == 5
    unit = np.eye(len(names))
    values = np.array([float(value) for value in start.values()])
    matrices = build(values)
    found = search(
        Parametrisation(build, slope, lambda _: unit),
        values,
        [(one.input, one.output) for one in experiments],
        initial=initial,
        # Without a noise model of its own the structure cannot make its errors white.
        white=with_gain and prefilter is None,
        stable=with_gain,
        max_iterations=max_iterations,
    )
    if found is None:
        raise overflowing("structure", focus)
    matrices = build(found.parameters)
    shape = LinearModel(
        method="structure",
        a=matrices.a,
        b=matrices.b,
        c=matrices.c,
        d=matrices.d,
        gain=matrices.gain,
        covariance=np.zeros((p, p)),
        **first.labels,
        samples=len(first),
        free=len(names),
    )
    return finished(shape, matrices, found, names, np.arange(len(names)), experiments, focus, prefilter)


def _matrices(given: tuple[ArrayLike, ...], m: int, p: int) -> Matrices:
    if len(given) not in {4, 5}:
        raise InputError(f"structure returns {len(given)} matrices; it must return A, B, C, D and, if wanted, K")
    arrays = [np.atleast_2d(np.asarray(part, dtype=float)) for part in given]
    n = len(arrays[0])
    if len(arrays) == 4:
        arrays.append(np.zeros((n, p)))
    wanted = ((n, n), (n, m), (p, n), (p, m), (n, p))
    for name, part, shape in zip("ABCDK", arrays, wanted, strict=True):
        if part.shape != shape:
            raise InputError(f"structure: {name} has shape {part.shape}; it must be {shape} for these data")
    return Matrices(*arrays)


def _held(matrices: Matrices, sample_time: float) -> Matrices:
    """Sampled with commands and innovations held."""
    from scipy.signal import cont2discrete

    (n, m), p = matrices.b.shape, len(matrices.c)
    driven = np.hstack([matrices.b, matrices.gain])
    if not (np.all(np.isfinite(matrices.a)) and np.all(np.isfinite(driven))):
        return Matrices(np.full((n, n), np.inf), matrices.b, matrices.c, matrices.d, matrices.gain)
    a, b, *_ = cont2discrete((matrices.a, driven, matrices.c, np.zeros((p, m + p))), sample_time)
    return Matrices(a, b[:, :m], matrices.c, matrices.d, b[:, m:])
