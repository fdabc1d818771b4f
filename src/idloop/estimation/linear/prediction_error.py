"""Prediction error method on a start model: all matrices, or those entries that are free."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from idloop.arrays import Array, Mask
from idloop.errors import IdloopError, InputError
from idloop.estimation.black_box.sampled import SampledData, check_fits, together
from idloop.estimation.linear.conversion import c2d
from idloop.estimation.linear.model import Coefficient, Focus, LinearModel, error_covariance, instability_notes
from idloop.estimation.linear.propagate import respond
from idloop.estimation.linear.search import Found, Parametrisation, mirrored, predictor_radius, search, stability_limit
from idloop.estimation.linear.sensitivity import Matrices
from idloop.estimation.observer.stationary import riccati
from idloop.estimation.statistics.collinear import collinearity_notes

if TYPE_CHECKING:
    import control
    from idloop.estimation.black_box.prefilter import Filter

_PARTS = ("a", "b", "c", "d", "gain")
_SCALED_ON = 20_000  # samples from which the scale of the states is taken


def start_model(start: LinearModel | control.StateSpace | control.TransferFunction, data: SampledData) -> LinearModel:
    """A model with the signals of the data; one that is a LinearModel already as it is."""
    import control

    if isinstance(start, LinearModel):
        return start
    if not isinstance(start, control.StateSpace | control.TransferFunction):
        raise InputError(
            f"start model of type {type(start).__name__}; give a LinearModel, as the estimators return, or a"
            " python-control StateSpace or TransferFunction"
        )
    outputs, inputs = data.output.shape[1], data.input.shape[1]
    if (start.ninputs, start.noutputs) != (inputs, outputs):
        raise InputError(
            f"{data.name}: {inputs} inputs and {outputs} outputs; the start model has {start.ninputs} and"
            f" {start.noutputs}"
        )
    sampled: Any = control.ss(c2d(start, data.sample_time) if start.isctime(strict=True) else start)
    labels = data.labels | {"sample_time": data.sample_time if sampled.dt in (None, True) else float(sampled.dt)}
    return LinearModel(
        method="given",
        a=np.asarray(sampled.A, dtype=float),
        b=np.asarray(sampled.B, dtype=float),
        c=np.asarray(sampled.C, dtype=float),
        d=np.asarray(sampled.D, dtype=float),
        gain=np.zeros((sampled.nstates, outputs)),
        covariance=np.full((outputs, outputs), np.nan),
        samples=0,
        free=0,
        **labels,
    )


def prediction_error(
    data: SampledData | Sequence[SampledData],
    start: LinearModel | control.StateSpace | control.TransferFunction,
    *,
    free: Mapping[str, ArrayLike] | None = None,
    focus: Focus = "prediction",
    feedthrough: bool | None = None,
    prefilter: Filter | None = None,
    initial: bool = True,
    max_iterations: int = 100,
) -> LinearModel:
    """Refine a model until its errors on the data are smallest.

    Minimises the determinant of the covariance of the one-step errors (Ljung, System Identification, 2nd ed.,
    section 7.4), from any start model. Without `free` all matrices are searched: of all directions those that only
    change the states' coordinates are left out (McKelvey, Helmersson and Ribarits, Automatica 40, 2004). Gradients
    are exact.

    Parameters
    ----------
    data : SampledData or sequence of SampledData
        Experiments of one system; offsets removed.
    start : LinearModel or python-control StateSpace or TransferFunction
        Of the order wanted; a continuous-time system is sampled, its commands held.
    free : mapping of "a", "b", "c", "d", "gain" to bool arrays, optional
        Entries that are estimated; all others keep the start model's values. Their values and standard errors are
        the coefficients of the result.
    focus : "prediction" or "simulation"
        Errors one step ahead, or of the free run; then the Kalman gain is zero, and a start model that is stable
        stays so: with its first state estimated, an unstable mode that cancels on the data is without bound beyond.
    feedthrough : bool, optional
        Whether D is searched, without `free`; by default where the start model has one.
    prefilter : python-control system or (numerator, denominator), optional
        Discrete filter with one input and output, applied to all signals: the fit counts what it passes. The Kalman
        gain is then that of the filtered outputs.
    initial : bool
        Estimate the first state of each experiment; else it is zero.

    Returns
    -------
    LinearModel
        Method "pem"; `start` is the method of the model that the search began from.

    Raises
    ------
    InputError
        Data of other signals than the start model's, a mask that does not suit it, or errors of the start model
        that overflow.
    """
    experiments = filtered(data, prefilter)
    start = start_model(start, experiments[0])
    check_fits(experiments[0], start.method, start.b.shape[1], start.c.shape[0], start.sample_time)
    gain = start.gain if focus == "prediction" else np.zeros_like(start.gain)
    matrices = Matrices(*(np.array(part, dtype=float) for part in (start.a, start.b, start.c, start.d, gain)))
    signals = [(one.input, one.output) for one in experiments]
    if free is None and focus == "prediction" and predictor_radius(matrices) > stability_limit(signals):
        matrices = replace(matrices, gain=_stabilising(matrices, experiments))
    with_d = bool(np.any(start.d)) if feedthrough is None else feedthrough
    searched = (True, True, True, with_d, focus == "prediction")
    if free is None:
        moving = np.repeat(searched, [part.size for part in matrices.parts])
        scale = _entry_scale(matrices, experiments)
        spread = np.diag(np.concatenate([one.output for one in experiments]).var(axis=0))
        parametrisation = replace(_entries(matrices, lambda point: _complement(matrices.like(point), scale, moving)))
        if focus == "prediction":
            parametrisation = replace(
                parametrisation, settle=lambda point: mirrored(matrices.like(point), spread).flat()
            )
    else:
        moving = _mask(free, matrices, focus)
        chosen = np.eye(moving.size)[:, moving]
        parametrisation = _entries(matrices, lambda _: chosen)
    found = search(
        parametrisation,
        matrices.flat(),
        signals,
        initial=initial,
        white=focus == "prediction" and prefilter is None,
        stable=focus == "prediction" or predictor_radius(matrices) <= stability_limit(signals),
        max_iterations=max_iterations,
    )
    if found is None:
        raise overflowing(start.method, focus)
    kept = np.flatnonzero(moving) if free is not None else np.zeros(0, dtype=int)
    names = [_entry_names(matrices)[i] for i in kept]
    shape = replace(start, method="pem", start=start.start or start.method, singular_values=None)
    return finished(shape, matrices.like(found.parameters), found, names, kept, experiments, focus, prefilter)


def finished(
    shape: LinearModel,
    matrices: Matrices,
    found: Found,
    names: Sequence[str],
    kept: NDArray[np.int_],
    experiments: Sequence[SampledData],
    focus: Focus,
    prefilter: Filter | None,
) -> LinearModel:
    """Model at the end of a search, with its error covariance, coefficients and notes."""
    notes = [] if found.converged else [f"not converged after {found.iterations} iterations"]
    if prefilter is not None:
        notes.append("fitted on filtered signals, whose noise the Kalman gain describes")
    covariance = found.covariance[np.ix_(kept, kept)]
    deviation = np.sqrt(np.diag(covariance))
    unseen = [name for name, value in zip(names, deviation, strict=True) if not np.isfinite(value)]
    if unseen:
        notes.append(f"not shown by the data: {', '.join(unseen)}")
    model = replace(
        shape,
        a=matrices.a,
        b=matrices.b,
        c=matrices.c,
        d=matrices.d,
        gain=matrices.gain,
        samples=sum(len(one) for one in experiments),
        free=found.free,
        coefficients=tuple(
            Coefficient(name, float(found.parameters[i]), float(s))
            for name, i, s in zip(names, kept, deviation, strict=True)
        ),
        coefficient_covariance=covariance if len(names) else None,
        notes=(*notes, *instability_notes(matrices.a)),
    )
    model = replace(model, covariance=error_covariance(model, experiments, focus))
    return replace(model, notes=(*model.notes, *collinearity_notes(experiments, model)))


def overflowing(name: str, focus: Focus) -> InputError:
    """Error for a start model whose errors grow without bound."""
    if focus == "simulation":
        what = 'its free run overflows on the data; refine it with focus "prediction"'
    else:
        what = "its predictor A - K C is unstable; give it a stabilising Kalman gain"
    return InputError(f"start model {name}: {what} or start from a stable model")


def filtered(data: SampledData | Sequence[SampledData], prefilter: Filter | None) -> list[SampledData]:
    """Experiments that belong together, all signals through the same filter."""
    # Polynomial models are linear models, so that a module-level import would be circular.
    from idloop.estimation.black_box.prefilter import prefiltered

    return prefiltered(together(data), prefilter)


def _entries(matrices: Matrices, free: Any) -> Parametrisation:
    """Parametrisation by the entries themselves."""
    unit = np.eye(matrices.flat().size)
    return Parametrisation(matrices.like, lambda _: unit, free)


def _complement(matrices: Matrices, scale: Array, moving: Mask) -> Array:
    """Basis of the entries' moves that do more than change the states' coordinates.

    A change of coordinates I + X moves the entries by (X A - A X, X B, -C X, 0, X K).
    """
    n = len(matrices.a)
    tangent = np.zeros((scale.size, n * n))
    for column, x in zip(tangent.T, np.eye(n * n).reshape(-1, n, n), strict=True):
        moved = (x @ matrices.a - matrices.a @ x, x @ matrices.b, -matrices.c @ x, 0.0 * matrices.d, x @ matrices.gain)
        column[:] = Matrices(*moved).flat()
    scaled = (tangent / scale[:, None])[moving]
    left, values, _ = np.linalg.svd(scaled, full_matrices=True)
    rank = int(np.sum(values > 1e-10 * np.max(values, initial=0.0)))
    basis = np.zeros((scale.size, left.shape[1] - rank))
    basis[moving] = left[:, rank:]
    return basis * scale[:, None]


def _entry_scale(matrices: Matrices, experiments: Sequence[SampledData]) -> Array:
    """Size of each entry that moves a state or an output by its own size."""
    first = experiments[0].part(0, _SCALED_ON)
    n, m = matrices.b.shape
    p = len(matrices.c)
    driven = np.hstack([matrices.b - matrices.gain @ matrices.d, matrices.gain])
    closed = matrices.a - matrices.gain @ matrices.c
    states = respond(
        closed, driven, np.eye(n), np.zeros((n, m + p)), np.zeros(n), np.hstack([first.input, first.output])
    )
    with np.errstate(over="ignore", invalid="ignore"):
        state, command, output = (_size(part) for part in (states, first.input, first.output))
    # Of A, B, C, D and K: (to, from).
    sizes = ((state, state), (state, command), (output, state), (output, command), (state, output))
    return Matrices(*(np.outer(to, 1 / source) for to, source in sizes)).flat()


def _size(signals: Array) -> Array:
    size = np.sqrt(np.mean(signals**2, axis=0))
    return np.where(np.isfinite(size) & (size > 0.0), size, 1.0)


def _stabilising(matrices: Matrices, experiments: Sequence[SampledData]) -> Array:
    """Some gain whose predictor forgets: of noise on every state and a little on the outputs."""
    n = len(matrices.a)
    commands = np.concatenate([one.input for one in experiments]).var(axis=0)
    outputs = np.concatenate([one.output for one in experiments]).var(axis=0)
    process = (matrices.b * commands) @ matrices.b.T
    process += 1e-3 * max(float(np.trace(process)), 1e-300) / n * np.eye(n)
    measurement = 1e-2 * np.diag(outputs)
    try:
        spread = riccati(matrices.a, matrices.c, process, measurement)
    except IdloopError:
        return matrices.gain
    innovation = matrices.c @ spread @ matrices.c.T + measurement
    return np.asarray(np.linalg.solve(innovation, matrices.c @ spread @ matrices.a.T).T)


def _mask(free: Mapping[str, ArrayLike], matrices: Matrices, focus: Focus) -> Mask:
    masks = []
    for name in free:
        if name not in _PARTS:
            raise InputError(f'free entries of "{name}"; the matrices are {", ".join(_PARTS)}')
    for name, part in zip(_PARTS, matrices.parts, strict=True):
        given = np.asarray(free.get(name, False), dtype=bool)
        if given.shape not in {(), part.shape}:
            raise InputError(f"free entries of {name} have shape {given.shape}; the matrix has {part.shape}")
        masks.append(np.broadcast_to(given, part.shape).ravel())
    moving = np.concatenate(masks)
    if focus == "simulation" and np.any(masks[-1]):
        raise InputError('free entries of gain, but the free run has none; use focus="prediction" or leave them out')
    if not np.any(moving):
        raise InputError("no entry is free; name at least one to estimate")
    return moving


def _entry_names(matrices: Matrices) -> list[str]:
    return [
        f"{name}[{row},{column}]"
        for name, part in zip(_PARTS, matrices.parts, strict=True)
        for row, column in np.ndindex(part.shape)
    ]
