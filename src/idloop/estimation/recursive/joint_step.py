"""One sample of the extended Kalman filter for the state and the coefficients of A y = B u, compiled."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from idloop.estimation.recursive.factored import limited, measured, propagated, variances
from idloop.estimation.recursive.step import COUNT, PROJECTED, SCALARS, VARIANCE, WEIGHT, stable

Array = NDArray[np.float64]
Whole = NDArray[np.int64]

# Mean of the squared innovations over the variances that the filter gives them: 1 where its noises are right.
# And the sum of the logarithms of those variances, which with it makes a likelihood.
FIT, LOGARITHMS, JOINT_SCALARS = SCALARS, SCALARS + 1, SCALARS + 2

# Standard deviations of a state, outputs being of size 1: at a start, and the most that a gap may leave.
STATE, LOST = 10.0, 100.0
_RUN_AWAY = 1e8
_HALVINGS = 6


@njit(cache=True, nogil=True)
def restart(state: Array, upper: Array, diagonal: Array) -> None:
    """Know nothing of the state any more; the covariance of the coefficients stays."""
    size = len(state)
    state[:] = 0.0
    # The coefficients come last, so that their block of U D U^T is theirs alone.
    upper[:size, :] = 0.0
    for k in range(size):
        upper[k, k] = 1.0
        diagonal[k] = STATE * STATE


@njit(cache=True, nogil=True)
def joint_advance(
    na: int, nb: Whole, nk: Whole, state: Array, theta: Array, upper: Array, diagonal: Array, past: Array,
    scalars: Array, inputs: Array, outputs: Array, noise: Array, measurement: float, forgetting: float, most: Array,
    radius: float, innovations: Array, values: Array, errors: Array, every: int, offset: int,
) -> None:  # fmt: skip
    """Run the filter over some samples; everything that it remembers is changed in place.

    `nb`, `nk` (m,): orders; `state` (s,): of the observer canonical form after the last sample; the output is its first
    component; `theta` (k,): coefficients, A's before B's; `upper`, `diagonal` (s + k, s + k), (s + k,): covariance of
    the state and the coefficients; `past` (m, lags): commands, the newest first; `scalars` (9,); `inputs`, `outputs`
    (n, m), (n,): an output of NaN is predicted and teaches nothing; an input of NaN is the one before; `noise` (s +
    k,): variances that the states and the coefficients gain in one sample; `measurement`: variance of the measurement
    noise, above 0; `forgetting`: weight of a sample over that of the next, for the coefficients; `most` (s + k,):
    variances that are not exceeded; `radius`: within which the roots of A are kept; `innovations` (n,): receives y less
    its prediction; `values`, `errors` ((offset + n) // every, k): receive the coefficients and their variances, every
    so many samples; `every`, `offset`: period of the rows, and samples since the last of them.
    """
    size, states, m = len(diagonal), len(state), len(nb)
    moved, work = np.zeros((size, size)), np.zeros((size, size + 1))
    gain, variance, ahead = np.zeros(size), np.zeros(size), np.zeros(states)
    direction, old = np.zeros(size), np.zeros(len(theta))
    direction[0] = 1.0
    narrower = np.sqrt(forgetting)
    for t in range(len(outputs)):
        for i in range(m):
            value = inputs[t, i]
            if np.isnan(value):
                value = past[i, 0]
            for k in range(past.shape[1] - 1, 0, -1):
                past[i, k] = past[i, k - 1]
            past[i, 0] = value
        # To the instant of this sample: the step is bilinear, `moved` is its derivative times U.
        first = state[0]
        for k in range(states):
            ahead[k] = state[k + 1] if k + 1 < states else 0.0
            if k < na:
                ahead[k] -= theta[k] * first
            for j in range(size):
                moved[k, j] = upper[k + 1, j] if k + 1 < states else 0.0
                if k < na:
                    moved[k, j] -= theta[k] * upper[0, j] + first * upper[states + k, j]
            place = na + k
            for i in range(m):
                if k < nb[i]:
                    command = past[i, nk[i]]
                    ahead[k] += theta[place] * command
                    for j in range(size):
                        moved[k, j] += command * upper[states + place, j]
                place += nb[i]
        for k in range(states, size):
            for j in range(size):
                moved[k, j] = upper[k, j]
        state[:] = ahead
        propagated(upper, diagonal, moved, noise, work)
        variances(upper, diagonal, variance)
        limited(upper, diagonal, variance, most)
        if not np.max(np.abs(state)) < _RUN_AWAY:
            restart(state, upper, diagonal)
            scalars[PROJECTED] += 1.0
        error = outputs[t] - state[0]
        innovations[t] = error
        if np.isfinite(error):
            total = measured(upper, diagonal, direction, measurement, gain)
            scalars[COUNT] += 1.0
            scalars[WEIGHT] = forgetting * scalars[WEIGHT] + 1.0
            scalars[FIT] += (error * error / total - scalars[FIT]) / scalars[WEIGHT]
            scalars[LOGARITHMS] += np.log(total)
            scalars[VARIANCE] = scalars[FIT] * total
            for k in range(states):
                state[k] += gain[k] * error
            old[:] = theta
            step = 1.0
            for halving in range(_HALVINGS + 1):
                for k in range(len(theta)):
                    theta[k] = old[k] + step * error * gain[states + k]
                if stable(theta[:na], radius):
                    break
                if halving == 0:
                    scalars[PROJECTED] += 1.0
                step = 0.0 if halving == _HALVINGS - 1 else 0.5 * step
            if forgetting < 1.0:
                # Coefficients only: of the state the process noise forgets.
                for k in range(states, size):
                    diagonal[k] /= forgetting
                    for j in range(states):
                        upper[j, k] *= narrower
        if (offset + t + 1) % every == 0:
            variances(upper, diagonal, variance)
            row = (offset + t) // every
            values[row] = theta
            errors[row] = variance[states:] * scalars[FIT]
