"""The recursion of a discrete state-space model, compiled."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]


@njit(cache=True)
def respond(a: Array, b: Array, c: Array, d: Array, state: Array, inputs: Array) -> Array:
    """Response of x(k+1) = A x(k) + B u(k), y(k) = C x(k) + D u(k).

    Parameters
    ----------
    a, b, c, d : ndarray, shapes (n, n), (n, m), (p, n), (p, m)
    state : ndarray, shape (n,)
        State at the first sample.
    inputs : ndarray, shape (N, m)

    Returns
    -------
    ndarray, shape (N, p)
    """
    samples, order = inputs.shape[0], a.shape[0]
    outputs = np.zeros((samples, c.shape[0]))
    x = state.copy()
    following = np.empty(order)
    for k in range(samples):
        for i in range(c.shape[0]):
            total = 0.0
            for j in range(order):
                total += c[i, j] * x[j]
            for j in range(inputs.shape[1]):
                total += d[i, j] * inputs[k, j]
            outputs[k, i] = total
        for i in range(order):
            total = 0.0
            for j in range(order):
                total += a[i, j] * x[j]
            for j in range(inputs.shape[1]):
                total += b[i, j] * inputs[k, j]
            following[i] = total
        x[:] = following
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
    predicted = np.zeros((samples, c.shape[0]))
    x = state.copy()
    for k in range(min(steps - 1, samples)):
        predicted[k] = c @ x + d @ inputs[k]
        x = a @ x + b @ inputs[k]
    x = state.copy()
    for k in range(samples - steps + 1):
        far = x.copy()
        for i in range(steps - 1):
            far = a @ far + b @ inputs[k + i]
        predicted[k + steps - 1] = c @ far + d @ inputs[k + steps - 1]
        error = outputs[k] - c @ x - d @ inputs[k]
        x = a @ x + b @ inputs[k] + gain @ error
    return predicted
