"""Nonlinear ARX model with a wavelet network, whose units are selected and not trained."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Literal

import numpy as np

from idloop.arrays import Array, Integers
from idloop.errors import InputError
from idloop.estimation.black_box.sampled import SampledData
from idloop.estimation.linear.least_squares import rows_in_blocks, solve, triangle
from idloop.estimation.networks.model import NarxModel
from idloop.estimation.networks.network import SCALING, WAVELET, Network, activations
from idloop.estimation.networks.training import TrainingHistory, TrainingRules, train
from idloop.estimation.networks.training_data import Division, Form, Preparation, TappedDelays, by_spread, prepare

_DEPENDENT = 1e-8  # what is left of a column's square when the chosen ones are taken out, below which it is theirs
_LEVELS = 5  # dyadic levels, each with dilations twice those of the one above
_CELLS = 200  # cells that are kept of each level, those with most samples
_ROWS = 6000  # training samples among which units are selected; all of them count for the weights
_MOST_UNITS = 60  # that an automatic choice may take


def select(base: Array, candidates: Array, targets: Array, count: int) -> Integers:
    """Candidates that explain most of what the base leaves over, one after the other.

    In each step the candidate is taken whose part orthogonal to all the chosen columns lowers the sum of squares
    most (Chen, Billings and Luo, Int. J. Control 50, 1989), over all targets together.

    `base` (n, b): columns that are in the model anyway; `candidates` (n, c): changed in place; `targets` (n, p);
    `count`: most candidates to take. Returns: in the order of their choice; fewer where the others depend on them.
    """
    basis = np.linalg.qr(base)[0]
    left = targets - basis @ (basis.T @ targets)
    size = np.sum(candidates**2, axis=0)
    for _ in range(2):
        # Twice, because candidates much like the base lose most of their digits the first time.
        candidates -= basis @ (basis.T @ candidates)
    open_ = np.ones(candidates.shape[1], dtype=bool)
    chosen: list[int] = []
    for _ in range(count):
        square = np.sum(candidates**2, axis=0)
        open_ &= square > _DEPENDENT * size
        if not np.any(open_):
            break
        gain = np.sum((candidates.T @ left) ** 2, axis=1) / np.where(open_, square, np.inf)
        best = int(np.argmax(gain))
        chosen.append(best)
        open_[best] = False
        unit = candidates[:, best] / np.sqrt(square[best])
        left = left - np.outer(unit, unit @ left)
        candidates -= np.outer(unit, unit @ candidates)
    return np.array(chosen, dtype=np.int64)


def narx_wavelet(
    data: SampledData | Sequence[SampledData],
    delays: TappedDelays | None = None,
    *,
    units: int | Literal["auto"] = 25,
    refine: TrainingRules | None = None,
    division: Division | None = None,
    form: Form = "series-parallel",
    seed: int = 0,
) -> NarxModel:
    """Linear part plus radial wavelets and scaling functions, selected by orthogonal least squares.

    Over the regressors, each scaled to unit variance, lies a dyadic grid of which only the cells that hold data carry a
    candidate, scaling functions at the coarsest level and wavelets at all of them; what they explain beyond the
    linear part decides (Zhang and Benveniste, IEEE Trans. Neural Networks 3, 1992; Zhang, IEEE Trans. Neural
    Networks 8, 1997). Far from the data the units vanish and the linear part remains.

    Parameters
    ----------
    delays : TappedDelays, optional
        Two past outputs and inputs by default.
    units : int or "auto"
        Scaling functions and wavelets together; 25 as in paper and toolbox. "auto" takes the number with the
        least validation error, or without validation data the least generalised cross-validation, in which each
        unit counts by the logarithm of the number of candidates that it was chosen from (after the risk inflation
        criterion of Foster and George, Ann. Statist. 22, 1994).
    refine : TrainingRules, optional
        Move and stretch the units and the linear part by Levenberg-Marquardt afterwards.
    division : Division, optional
        All samples for training by default.
    form : {"series-parallel", "parallel"}
        Parallel, which needs `refine`, fits the free run.
    seed : int
        Of the division.

    Raises
    ------
    InputError
        Too little data for the network, or numbers out of range.
    """
    delays, division = delays or TappedDelays(), division or Division(1.0, 0.0, 0.0)
    most = _MOST_UNITS if units == "auto" else units
    if most < 1:
        raise InputError(f"{most} units; give a number from 1, or 'auto'")
    if form not in {"series-parallel", "parallel"}:
        raise InputError(f"form {form!r}; take 'series-parallel' or 'parallel'")
    if form == "parallel" and refine is None:
        raise InputError("form 'parallel' is found by training; give refine=TrainingRules()")
    least = 1 if units == "auto" else most
    random = np.random.default_rng(seed)
    prepared = prepare(data, delays, division, random, lambda r, p: p * (1 + r + least))
    network, history = _selected(prepared, most, automatic=units == "auto")
    notes: tuple[str, ...] = ()
    if units != "auto" and network.kind.size < most:
        notes = (f"the data determine only {network.kind.size} units",)
    if refine is not None:
        network, history = train(network, prepared.data, refine, with_linear=True)
        if form == "parallel":
            network, history = train(network, prepared.data, refine, parallel=True, with_linear=True)
    return NarxModel.of("narx-wavelet", prepared, network, history, form, notes)


def dyadic_grid(z: Array, levels: int, cells: int) -> tuple[Integers, Array, Array]:
    """Candidates on a dyadic grid, only where there are samples."""
    radius = max(float(np.percentile(np.linalg.norm(z, axis=1), 99.0)), 1e-12)
    kinds, centers, dilations = [], [], []
    for level in range(levels):
        dilation = 2.0**level / radius
        nodes, held = np.unique(np.rint(z * dilation), axis=0, return_counts=True)
        # A cell with hardly more samples than directions would make a unit that fits noise.
        order = np.argsort(-held, kind="stable")[:cells]
        order = order[held[order] > z.shape[1]]
        for kind in (SCALING, WAVELET) if level == 0 else (WAVELET,):
            kinds.append(np.full(order.size, kind, dtype=np.int64))
            centers.append(nodes[order] / dilation)
            dilations.append(np.full(order.size, dilation))
    return np.concatenate(kinds), np.ascontiguousarray(np.concatenate(centers)), np.concatenate(dilations)


def _selected(prepared: Preparation, most: int, *, automatic: bool) -> tuple[Network, TrainingHistory]:
    """Linear part and selected units, weights by least squares over all training samples."""
    center, width = by_spread(prepared.train)
    d, p = center.size, prepared.output_center.size
    targets = prepared.targets()
    chosen_rows = prepared.split.train[:: max(1, -(-prepared.split.train.size // _ROWS))]
    z = (prepared.rows() - center) / width
    few = np.ascontiguousarray(z[chosen_rows])
    kind, nodes, dilation = dyadic_grid(few, _LEVELS, _CELLS)
    network = prepared.network(center, width, kind, nodes, dilation, np.zeros((p, kind.size)))
    base = np.column_stack([np.ones(len(few)), few])
    order = select(base, activations(network, few), targets[chosen_rows], most)
    network = network._replace(
        kind=kind[order],
        direction=np.ascontiguousarray(nodes[order]),
        scale=dilation[order],
        weight=np.zeros((p, order.size)),
    )
    purposes = (prepared.split.train, prepared.split.validation, prepared.split.test)
    factors = [triangle(_rows(network, z, targets, rows)) if rows.size else np.zeros((0, 0)) for rows in purposes]
    counts = np.array([rows.size for rows in purposes])
    curve, solutions = _path(factors, counts * p, d + 1, order.size, p)
    # A unit that is the best of many has fitted more noise than one given beforehand: by the logarithm of their number.
    used = d + 1 + np.arange(order.size + 1) * np.log(max(kind.size, 2))
    if not automatic:
        best, stop = order.size, f"{order.size} units"
    elif counts[1]:
        best, stop = int(np.nanargmin(curve[:, 1])), "validation"
    else:
        spare = 1.0 - used / counts[0]
        cost = np.where(spare > 0, curve[:, 0] / np.maximum(spare, 1e-9) ** 2, np.inf)
        best, stop = int(np.argmin(cost)), "generalised cross-validation"
    solution = solutions[best]
    keep = slice(0, best)
    network = network._replace(
        kind=network.kind[keep],
        direction=np.ascontiguousarray(network.direction[keep]),
        scale=network.scale[keep],
        weight=np.ascontiguousarray(solution[d + 1 :].T),
        constant=np.ascontiguousarray(solution[0]),
        linear=np.ascontiguousarray(solution[1 : d + 1].T),
    )
    nothing = np.full(len(curve), np.nan)
    return network, TrainingHistory(curve[:, 0], curve[:, 1], curve[:, 2], nothing, nothing, best, stop, "unit")


def _rows(network: Network, z: Array, targets: Array, rows: Integers) -> Iterator[Array]:
    """Blocks of the columns (1, z, units, targets) at some rows."""
    for begin, end in rows_in_blocks(rows.size, 0):
        here = np.ascontiguousarray(z[rows[begin:end]])
        yield np.column_stack([np.ones(len(here)), here, activations(network, here), targets[rows[begin:end]]])


def _path(factors: Sequence[Array], counts: Integers, base: int, most: int, p: int) -> tuple[Array, list[Array]]:
    """Mean squares over training, validation and test, and the weights, for each number of units."""
    curve: Array = np.full((most + 1, 3), np.nan)
    solutions: list[Array] = []
    columns = base + most
    train = factors[0]
    for number in range(most + 1):
        used = base + number
        solution = solve(train[:, :used], train[:, columns:], 1e-12)
        solutions.append(solution)
        for index, (factor, count) in enumerate(zip(factors, counts, strict=True)):
            if count:
                left = factor[:, columns:] - factor[:, :used] @ solution
                curve[number, index] = np.sum(left**2) / count
    return curve, solutions
