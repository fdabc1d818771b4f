"""Response of a discrete state-space model, compiled, and its first state by least squares."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from idloop.estimation.compiled import inner
from idloop.estimation.linear.least_squares import solve, triangle

Array = NDArray[np.float64]
_LONGEST = 20_000  # samples: a mode that has not decayed by then is nearly constant in the rest as well
_REWEIGHTINGS = 3  # rounds of iteratively reweighted least squares
_LEAST_SHARE = 1e-9  # of an output's size: errors below are rounding


@inner
def _weigh(left: Array, x: Array, right: Array, u: Array, out: Array) -> None:
    """A x + B u into `out`."""
    for i in range(left.shape[0]):
        total = 0.0
        for j in range(left.shape[1]):
            total += left[i, j] * x[j]
        for j in range(right.shape[1]):
            total += right[i, j] * u[j]
        out[i] = total


@inner
def _move(a: Array, b: Array, x: Array, u: Array, following: Array) -> None:
    """The state after one more sample, in place."""
    _weigh(a, x, b, u, following)
    for i in range(x.shape[0]):
        x[i] = following[i]


@njit(cache=True)
def respond(a: Array, b: Array, c: Array, d: Array, state: Array, inputs: Array) -> Array:
    """Response of x(k+1) = A x(k) + B u(k), y(k) = C x(k) + D u(k).

    `a`, `b`, `c`, `d` (n, n), (n, m), (p, n), (p, m); `state` (n,): state at the first sample; `inputs` (N, m). Returns
    shape (N, p).
    """
    samples, order = inputs.shape[0], a.shape[0]
    outputs = np.zeros((samples, c.shape[0]))
    x = state.copy()
    following = np.empty(order)
    for k in range(samples):
        _weigh(c, x, d, inputs[k], outputs[k])
        _move(a, b, x, inputs[k], following)
    return outputs


@njit(cache=True)
def ahead(
    a: Array, b: Array, c: Array, d: Array, gain: Array, state: Array, inputs: Array, outputs: Array, steps: int
) -> Array:
    """Prediction `steps` samples ahead by the model in innovation form with Kalman gain K.

    The state is corrected by every measurement up to `steps` samples before the predicted one
    (Ljung, System Identification, 2nd ed., section 3.2).

    `a`, `b`, `c`, `d` (n, n), (n, m), (p, n), (p, m); `gain` (n, p); `state` (n,): predicted state at the first sample;
    `inputs` (N, m); `outputs` (N, p): measurements; `steps`: at least 1. Returns shape (N, p): the first `steps - 1`
    rows are predicted from the first state alone.
    """
    samples = inputs.shape[0]
    order, count = c.shape[1], c.shape[0]
    predicted = np.zeros((samples, count))
    x, far, before, error = state.copy(), state.copy(), np.empty(order), np.empty(count)
    for k in range(min(steps - 1, samples)):
        _weigh(c, x, d, inputs[k], predicted[k])
        _move(a, b, x, inputs[k], before)
    for i in range(order):
        x[i] = state[i]
    for k in range(samples - steps + 1):
        for i in range(order):
            far[i] = x[i]
        for i in range(steps - 1):
            _move(a, b, far, inputs[k + i], before)
        _weigh(c, far, d, inputs[k + steps - 1], predicted[k + steps - 1])
        _weigh(c, x, d, inputs[k], error)
        _move(a, b, x, inputs[k], before)
        for i in range(order):
            for j in range(count):
                x[i] += gain[i, j] * (outputs[k, j] - error[j])
    return predicted


def initial_state(a: Array, c: Array, rest: Array) -> Array:
    """State that explains best what the model's response from rest leaves of the outputs.

    Each output counts in units of its own errors, so that a noisy one does not spoil the estimate of a
    mode that never dies away, such as an integrator's.

    `a`, `c` (n, n), (p, n): of the model; of the predictor (A - K C) for prediction; `rest` (N, p): measured output
    minus the response from the zero state. Returns shape (n,): of smallest norm where the outputs do not show the whole
    state.
    """
    order = a.shape[0]
    if order == 0 or rest.shape[0] == 0:
        return np.zeros(order)
    used = rest[:_LONGEST]
    none = np.zeros((used.shape[0], 1))
    b, d = np.zeros((order, 1)), np.zeros((c.shape[0], 1))
    free = np.stack([respond(a, b, c, d, unit, none) for unit in np.eye(order)], axis=-1)
    # Of a free response that overflows only the samples before count.
    finite = np.all(np.isfinite(free) & (np.abs(free) < 1e12), axis=(1, 2))
    last = used.shape[0] if finite.all() else int(np.argmin(finite))
    columns, target = free[:last], used[:last]
    size = np.sqrt(np.mean(target**2, axis=0))
    floor = np.where(size > 0.0, _LEAST_SHARE * size, 1.0)
    deviation, state = np.maximum(size, floor), np.zeros(order)
    # Each output's response and measurements as one triangle: every round then weighs a few rows.
    triangles = [triangle([np.column_stack([columns[:, j], target[:, j]])]) for j in range(len(c))]
    for _ in range(_REWEIGHTINGS if len(c) > 1 else 1):
        rows = np.concatenate([one / d for one, d in zip(triangles, deviation, strict=True)])
        state = solve(rows[:, :-1], rows[:, -1])
        left = [float(np.linalg.norm(one[:, -1] - one[:, :-1] @ state)) for one in triangles]
        deviation = np.maximum(np.array(left) / np.sqrt(last), floor)
    return state
