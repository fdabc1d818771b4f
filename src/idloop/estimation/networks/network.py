"""A network of tanh or radial units behind tapped delays: its numbers, its output and its slopes, compiled.

The output is f(z) = d + L z + Σ c_j φ_j(z) with z the scaled regressors and φ_j one of

- a sigmoid of a plane, tanh(w_j·z + b_j) (neural network),
- a radial scaling function exp(-s/2), s = a_j² |z - t_j|²,
- a radial wavelet (dim z - s) exp(-s/2) (Zhang and Benveniste, IEEE Trans. Neural Networks 3, 1992).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from idloop.estimation.compiled import seldom

Array = NDArray[np.float64]

SIGMOID, SCALING, WAVELET = 0, 1, 2


class Network(NamedTuple):
    """All numbers of a network, in the form that the compiled functions read.

    `source`, `lag` (r,): signal and delay of each regressor (``TappedDelays.taps``); `output_center`, `output_width`
    (p,): the outputs are center + width f(z) [output units].
    """

    source: NDArray[np.int64]
    lag: NDArray[np.int64]
    center: Array  # shape (r,): subtracted from the regressors [their units]
    width: Array  # shape (r,): by which what is left is divided: z = (regressors - center) / width
    kind: NDArray[np.int64]  # shape (h,): of each unit
    direction: Array  # shape (h, r): weights w of a sigmoid, centre t of a radial unit
    scale: Array  # shape (h,): bias b of a sigmoid, dilation a of a radial unit
    weight: Array  # shape (p, h): output weights c
    constant: Array  # shape (p,): d
    linear: Array  # shape (p, r): L; zero in a neural network
    output_center: Array
    output_width: Array


def parameters(network: Network, with_linear: bool) -> Array:
    """Adjustable numbers in one vector: directions, scales, weights, constants and, with a linear part, L."""
    parts = [network.direction, network.scale, network.weight, network.constant]
    if with_linear:
        parts.append(network.linear)
    return np.concatenate([part.ravel() for part in parts])


def with_parameters(network: Network, values: Array, with_linear: bool) -> Network:
    """The network with other adjustable numbers, in the order of `parameters`."""
    names = ["direction", "scale", "weight", "constant"] + (["linear"] if with_linear else [])
    changed, at = {}, 0
    for name in names:
        shape = getattr(network, name).shape
        size = int(np.prod(shape))
        changed[name] = np.ascontiguousarray(values[at : at + size].reshape(shape))
        at += size
    return network._replace(**changed)


@seldom
def _regressors(network: Network, k: int, inputs: Array, outputs: Array, origin: int, own: Array, z: Array) -> None:
    """Scaled regressors of sample k; outputs from `origin` on are the model's own."""
    p = outputs.shape[1]
    for i in range(network.source.size):
        signal, at = network.source[i], k - network.lag[i]
        if signal >= p:
            value = inputs[at, signal - p]
        elif at >= origin:
            value = own[at - origin, signal]
        else:
            value = outputs[at, signal]
        z[i] = (value - network.center[i]) / network.width[i]


@seldom
def _distance(network: Network, unit: int, z: Array) -> float:
    total = 0.0
    for j in range(z.size):
        total += (z[j] - network.direction[unit, j]) ** 2
    return total


@seldom
def _unit(network: Network, unit: int, z: Array) -> float:
    if network.kind[unit] == SIGMOID:
        argument = network.scale[unit]
        for j in range(z.size):
            argument += network.direction[unit, j] * z[j]
        return float(np.tanh(argument))
    square = network.scale[unit] ** 2 * _distance(network, unit, z)
    bell = float(np.exp(-0.5 * square))
    return bell if network.kind[unit] == SCALING else (z.size - square) * bell


@seldom
def _evaluate(network: Network, z: Array, result: Array) -> None:
    """Outputs in their own units."""
    for i in range(result.size):
        result[i] = network.constant[i]
        for j in range(z.size):
            result[i] += network.linear[i, j] * z[j]
    for unit in range(network.kind.size):
        value = _unit(network, unit, z)
        for i in range(result.size):
            result[i] += network.weight[i, unit] * value
    for i in range(result.size):
        result[i] = network.output_center[i] + network.output_width[i] * result[i]


@njit(cache=True)
def activations(network: Network, z: Array) -> Array:
    """Values of all units at scaled regressors, shape (N, r) to (N, h)."""
    values = np.empty((z.shape[0], network.kind.size))
    for k in range(z.shape[0]):
        for unit in range(network.kind.size):
            values[k, unit] = _unit(network, unit, z[k])
    return values


@njit(cache=True)
def ahead(network: Network, inputs: Array, outputs: Array, first: int, steps: int, low: Array, high: Array) -> Array:
    """Prediction `steps` samples ahead: 1 is the series-parallel form, all that follow `first` the parallel one.

    `inputs`, `outputs` (N, m) and (N, p); `first`: first sample that is predicted; those before are copied from
    `outputs`; `steps`: samples since the last measurement that a prediction uses; `low`, `high` (p,): the model's
    outputs are held between these, so that a run that diverges stays finite. Returns shape (N, p).
    """
    samples, p = outputs.shape
    predicted: Array = outputs.copy()
    z, result = np.empty(network.center.size), np.empty(p)
    if steps >= samples - first:
        for k in range(first, samples):
            _regressors(network, k, inputs, outputs, first, predicted[first:], z)
            _evaluate(network, z, result)
            for i in range(p):
                predicted[k, i] = min(max(result[i], low[i]), high[i])
        return predicted
    own = np.empty((steps, p))
    for k in range(first, samples):
        origin = max(k - steps + 1, first)
        for at in range(origin, k + 1):
            _regressors(network, at, inputs, outputs, origin, own, z)
            _evaluate(network, z, result)
            for i in range(p):
                own[at - origin, i] = min(max(result[i], low[i]), high[i])
        for i in range(p):
            predicted[k, i] = own[k - origin, i]
    return predicted


@seldom
def _slopes(network: Network, with_linear: bool, z: Array, by_parameter: Array, by_regressor: Array) -> None:
    """Slopes of f at z: by the parameters, shape (p, k), and by the scaled regressors, shape (p, r)."""
    h, d = network.direction.shape
    p = network.weight.shape[0]
    by_parameter[:] = 0.0
    for i in range(p):
        by_parameter[i, h * d + h + p * h + i] = 1.0
        for j in range(d):
            by_regressor[i, j] = network.linear[i, j]
            if with_linear:
                by_parameter[i, h * d + h + p * h + p + i * d + j] = z[j]
    for unit in range(h):
        value = _unit(network, unit, z)
        sigmoid = network.kind[unit] == SIGMOID
        if sigmoid:
            inner = 1.0 - value * value
            by_scale = inner
        else:
            distance, a = _distance(network, unit, z), network.scale[unit]
            square = a * a * distance
            bell = np.exp(-0.5 * square)
            inner = -0.5 * bell if network.kind[unit] == SCALING else -bell * (1.0 + 0.5 * (d - square))
            by_scale = inner * 2.0 * a * distance
        for i in range(p):
            c = network.weight[i, unit]
            by_parameter[i, h * d + unit] = c * by_scale
            by_parameter[i, h * d + h + i * h + unit] = value
            for j in range(d):
                if sigmoid:
                    by_parameter[i, unit * d + j] = c * inner * z[j]
                    by_regressor[i, j] += c * inner * network.direction[unit, j]
                else:
                    turn = c * inner * 2.0 * a * a * (z[j] - network.direction[unit, j])
                    by_parameter[i, unit * d + j] = -turn
                    by_regressor[i, j] += turn


@njit(cache=True)
def slopes(
    network: Network, with_linear: bool, inputs: Array, past: Array, begin: int, end: int, carry: Array, feedback: bool
) -> Array:
    """Slopes of the scaled outputs by the parameters at samples `begin` to `end` - 1, shape (end - begin, p, k).

    `with_linear`: whether the linear part is adjustable; `inputs`, `past` (N, m) and (N, p): past outputs as the
    network sees them: measured (series-parallel) or its own free run (parallel); `begin`, `end`: samples; with feedback
    in the order of time and without a gap; `carry` (longest lag, p, k): with feedback, the slopes of the samples
    before, sample by sample modulo its length; updated; `feedback`: whether past outputs depend on the parameters as
    well (parallel form).
    """
    p, depth = past.shape[1], carry.shape[0]
    found = np.empty((end - begin, p, carry.shape[2]))
    z = np.empty(network.center.size)
    by_regressor = np.empty((p, z.size))
    for k in range(begin, end):
        _regressors(network, k, inputs, past, past.shape[0], past, z)
        row = found[k - begin]
        _slopes(network, with_linear, z, row, by_regressor)
        if feedback:
            for r in range(network.source.size):
                signal = network.source[r]
                if signal >= p:
                    continue
                before = carry[(k - network.lag[r]) % depth, signal]
                for i in range(p):
                    slope = by_regressor[i, r] * network.output_width[signal] / network.width[r]
                    for q in range(row.shape[1]):
                        row[i, q] += slope * before[q]
            for i in range(p):
                for q in range(row.shape[1]):
                    carry[k % depth, i, q] = row[i, q]
    return found
