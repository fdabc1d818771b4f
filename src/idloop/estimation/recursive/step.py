"""One sample of the recursion for A y = sum B / F u + C / D e, with the covariance as U D U^T, compiled."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from idloop.estimation.compiled import seldom

Array = NDArray[np.float64]
Whole = NDArray[np.int64]
# Rows of the memory: output and filtered output, then six of each input, then four of the noise.
OUTPUT, OUTPUT_FILTERED, INPUTS = range(3)
INPUT, INPUT_OVER_F, INPUT_FILTERED, PLANT, PLANT_OVER_F, PLANT_FILTERED, ROWS_PER_INPUT = range(7)
ERROR, ERROR_FILTERED, DISTURBANCE, DISTURBANCE_FILTERED, ROWS_OF_NOISE = range(5)
# Further numbers of the state of the recursion.
FORGETTING, VARIANCE, COUNT, TURN, PROJECTED, WEIGHT, WEIGHT_SQUARED, SCALARS = range(8)
_HALVINGS = 6


@njit(cache=True, nogil=True)
def measurement_update(upper: Array, diagonal: Array, direction: Array, noise: float, gain: Array) -> float:
    """Take in one scalar measurement: P becomes P - P h h^T P / (h^T P h + r), in O(k^2).

    Bierman, Factorization Methods for Discrete Sequential Estimation, 1977, section V.3.

    `upper` (k, k): unit upper triangular U, changed in place; `diagonal` (k,): D, changed in place; `direction` (k,):
    h; `noise`: r, above 0; `gain` (k,): receives P h / (h^T P h + r). Returns: h^T P h + r with the P from before.
    """
    size = len(diagonal)
    total = noise
    for j in range(size):
        along = direction[j]
        for i in range(j):
            along += upper[i, j] * direction[i]
        share = diagonal[j] * along
        before = total
        total = before + along * share
        diagonal[j] *= before / total
        gain[j] = share
        for i in range(j):
            old = upper[i, j]
            upper[i, j] = old - gain[i] * along / before
            gain[i] += old * share
    for j in range(size):
        gain[j] /= total
    return total


@njit(cache=True, nogil=True)
def add_variance(upper: Array, diagonal: Array, index: int, variance: float, work: Array) -> None:
    """Add to the variance of one coefficient, in O(k^2) (rank-one update of Agee and Turner, 1972).

    `upper`, `diagonal` (k, k), (k,): changed in place; `variance`: 0 or more; `work` (k,).
    """
    work[:] = 0.0
    work[index] = 1.0
    rest = variance
    for j in range(index, -1, -1):
        own = work[j]
        new = diagonal[j] + rest * own * own
        if new <= 0.0:
            continue
        factor = rest / new
        rest = factor * diagonal[j]
        diagonal[j] = new
        for i in range(j):
            work[i] -= own * upper[i, j]
            upper[i, j] += factor * own * work[i]


@njit(cache=True, nogil=True)
def time_update(upper: Array, diagonal: Array, moved: Array, noise: Array, work: Array) -> None:
    """Take a step in time: P becomes F P F^T + Q with a diagonal Q, in O(k^3).

    Weighted Gram-Schmidt orthogonalization of Thornton (Bierman, 1977, section VI.4).

    `upper`, `diagonal` (k, k), (k,): changed in place; `moved` (k, k): F U; used up; `noise` (k,): diagonal of Q, 0 or
    more; `work` (k, k + 1).
    """
    size = len(diagonal)
    own, old = work[:, :size], work[:, size]
    own[:] = 0.0
    for i in range(size):
        own[i, i] = 1.0
        old[i] = diagonal[i]
    upper[:] = 0.0
    for j in range(size - 1, -1, -1):
        total = 0.0
        for k in range(size):
            total += moved[j, k] * moved[j, k] * old[k] + own[j, k] * own[j, k] * noise[k]
        diagonal[j] = total
        upper[j, j] = 1.0
        if total <= 0.0:
            continue
        for i in range(j):
            product = 0.0
            for k in range(size):
                product += moved[i, k] * moved[j, k] * old[k] + own[i, k] * own[j, k] * noise[k]
            share = product / total
            upper[i, j] = share
            for k in range(size):
                moved[i, k] -= share * moved[j, k]
                own[i, k] -= share * own[j, k]


@njit(cache=True, nogil=True)
def variances(upper: Array, diagonal: Array, result: Array) -> None:
    """Diagonal of U D U^T into `result`, shape (k,)."""
    size = len(diagonal)
    for i in range(size):
        total = diagonal[i]
        for j in range(i + 1, size):
            total += upper[i, j] * upper[i, j] * diagonal[j]
        result[i] = total


@njit(cache=True, nogil=True)
def limit_variances(upper: Array, diagonal: Array, variance: Array, most: Array) -> None:
    """Shrink the coefficients whose variance is above its limit to it, correlations kept.

    What is not excited would otherwise grow without end under forgetting (covariance wind-up); what is excited
    keeps on forgetting.

    `upper`, `diagonal` (k, k), (k,): changed in place; `variance` (k,): of `variances`; changed in place; `most` (k,).
    """
    size = len(diagonal)
    for i in range(size):
        if variance[i] > most[i]:
            factor = np.sqrt(most[i] / variance[i])
            for j in range(i + 1, size):
                upper[i, j] *= factor
            for j in range(i):
                upper[j, i] /= factor
            diagonal[i] *= factor * factor
            variance[i] = most[i]


@njit(cache=True, nogil=True)
def stable(tail: Array, radius: float) -> bool:
    """Whether the roots of 1 + p1 q^-1 + ... lie inside a circle (Schur and Cohn's test, O(n^2))."""
    size = len(tail)
    p = np.empty(size + 1)
    p[0] = 1.0
    power = 1.0
    for k in range(size):
        power *= radius
        p[k + 1] = tail[k] / power
        if not np.isfinite(p[k + 1]):
            return False
    for order in range(size, 0, -1):
        reflection = p[order] / p[0]
        if abs(reflection) >= 1.0:
            return False
        for k in range((order + 1) // 2 + 1):
            if k > order - k:
                break
            low, high = p[k], p[order - k]
            p[k] = low - reflection * high
            p[order - k] = high - reflection * low
    return True


@seldom
def _predictor_stable(theta: Array, na: int, nc: int, nd: int, nb: Whole, nf: Whole, radius: float) -> bool:
    place = na
    for i in range(len(nb)):
        place += nb[i]
    if not stable(theta[place : place + nc], radius):
        return False
    place += nc + nd
    for i in range(len(nf)):
        if not stable(theta[place : place + nf[i]], radius):
            return False
        place += nf[i]
    return True


@njit(cache=True, nogil=True)
def spread(scalars: Array) -> float:
    """Factor from the recursion's P to the covariance of the coefficients.

    Weighted least squares with weights w and errors of variance r has the covariance r P sum w^2 / sum w.
    """
    share = scalars[WEIGHT_SQUARED] / scalars[WEIGHT] if scalars[WEIGHT] > 0.0 else 1.0
    return float(scalars[VARIANCE] * share)


@seldom
def _push(row: Array, value: float) -> None:
    for k in range(len(row) - 1, 0, -1):
        row[k] = row[k - 1]
    row[0] = value


@seldom
def _recursive(value: float, past: Array, tail: Array) -> float:
    """Value through 1 / P: minus sum p_k past(t - k), `past` beginning at t - 1."""
    for k in range(len(tail)):
        value -= tail[k] * past[k]
    return value


@seldom
def _remember(value: float, f: Array, c: Array, d: Array, over_f: Array, filtered: Array) -> None:
    """Push a signal through 1 / F, and that through D / C, as the gradient needs them."""
    over = _recursive(value, over_f, f)
    moving = over
    for k in range(len(d)):
        moving += d[k] * over_f[k]
    _push(filtered, _recursive(moving, filtered, c))
    _push(over_f, over)


@seldom
def _carry(covariance: Array, gain: Array, gradient: Array, step: float, most: Array, work: Array) -> None:
    """(I - K psi^T) P (I - K psi^T)^T + K K^T, for errors of variance 1, in O(k^2).

    Large first gains make that grow without end where the projection keeps the coefficients in: hence the limits.
    """
    size = len(gain)
    total = 1.0
    for i in range(size):
        along = 0.0
        for j in range(size):
            along += covariance[i, j] * gradient[j]
        work[i] = along
        total += gradient[i] * along
    for i in range(size):
        own = step * gain[i]
        for j in range(i + 1):
            other = step * gain[j]
            covariance[i, j] += own * other * total - own * work[j] - work[i] * other
            covariance[j, i] = covariance[i, j]
    for i in range(size):
        if covariance[i, i] > most[i]:
            factor = np.sqrt(most[i] / covariance[i, i])
            for j in range(size):
                covariance[i, j] *= factor
                covariance[j, i] *= factor


@njit(cache=True, nogil=True)
def advance(
    na: int, nc: int, nd: int, nb: Whole, nf: Whole, nk: Whole,
    theta: Array, upper: Array, diagonal: Array, carried: Array, past: Array, scalars: Array,
    inputs: Array, outputs: Array,
    final_forgetting: float, growth: float, walk: Array, most: Array, gradient: bool, radius: float,
    innovations: Array, values: Array, errors: Array, every: int, offset: int,
) -> None:  # fmt: skip
    """Run the recursion over some samples; everything that it remembers is changed in place.

    Ljung and Soederstroem, Theory and Practice of Recursive Identification, 1983, section 3.7 (the general
    model: eq. 3.119 to 3.125); Ljung, System Identification, 2nd ed., section 11.7.

    `nb`, `nf`, `nk` (m,): orders; `theta` (k,): coefficients in the order of `Orders.names`; `upper`, `diagonal` (k,
    k), (k,): covariance over the variance of the innovations; of a pseudo-linear regression what its gain comes from;
    `carried` (k, k), or (0, 0): covariance of a pseudo-linear regression over the variance of the innovations; `past`
    (rows, lags): signals, the newest first; `scalars` (7,); `inputs`, `outputs` (n, m), (n,): an output of NaN is
    predicted and teaches nothing; an input of NaN is the one before; `final_forgetting`, `growth`: the forgetting
    factor grows to the first as l(t) = g l(t-1) + (1 - g) times it; `walk` (k,): variance that each coefficient gains
    in one sample; all 0 for a factor alone; `most` (k,): variances that are not exceeded; `gradient`: regressors
    filtered to the gradient (prediction-error), or as they are (pseudo-linear); `radius`: within which the roots of C
    and F are kept; `innovations` (n,): receives y less its prediction; `values`, `errors` ((offset + n) // every, k):
    receive the coefficients and their variances, every so many samples; `every`, `offset`: period of the rows, and
    samples since the last of them.
    """
    size, m = len(theta), len(nb)
    phi, psi, gain, work = np.zeros(size), np.zeros(size), np.zeros(size), np.zeros(size)
    old, variance = np.zeros(size), np.zeros(size)
    noise = INPUTS + ROWS_PER_INPUT * m
    first_c = na
    for i in range(m):
        first_c += nb[i]
    first_d = first_c + nc
    first_f = first_d + nd
    walking = np.any(walk > 0.0)
    forgets = final_forgetting < 1.0 or growth > 0.0
    for t in range(len(outputs)):
        c, d = theta[first_c:first_d], theta[first_d:first_f]
        # The command of this sample comes first: a model without delay uses it.
        place_f = first_f
        for i in range(m):
            base = INPUTS + ROWS_PER_INPUT * i
            value = inputs[t, i]
            if np.isnan(value):
                value = past[base + INPUT, 0]
            _push(past[base + INPUT], value)
            f = theta[place_f : place_f + nf[i]]
            _remember(value, f, c, d, past[base + INPUT_OVER_F], past[base + INPUT_FILTERED])
            place_f += nf[i]
        for k in range(na):
            phi[k] = -past[OUTPUT, k]
            psi[k] = -past[OUTPUT_FILTERED, k]
        place_b, place_f = na, first_f
        for i in range(m):
            base = INPUTS + ROWS_PER_INPUT * i
            for k in range(nb[i]):
                phi[place_b + k] = past[base + INPUT, nk[i] + k]
                psi[place_b + k] = past[base + INPUT_FILTERED, nk[i] + k]
            for k in range(nf[i]):
                phi[place_f + k] = -past[base + PLANT, k]
                psi[place_f + k] = -past[base + PLANT_FILTERED, k]
            place_b += nb[i]
            place_f += nf[i]
        for k in range(nc):
            phi[first_c + k] = past[noise + ERROR, k]
            psi[first_c + k] = past[noise + ERROR_FILTERED, k]
        for k in range(nd):
            phi[first_d + k] = -past[noise + DISTURBANCE, k]
            psi[first_d + k] = -past[noise + DISTURBANCE_FILTERED, k]
        along = psi if gradient else phi
        predicted = 0.0
        for k in range(size):
            predicted += theta[k] * phi[k]
        y = outputs[t]
        error = y - predicted
        innovations[t] = error
        known = np.isfinite(error)
        if known:
            forgetting = scalars[FORGETTING]
            total = measurement_update(upper, diagonal, along, forgetting, gain)
            scalars[FORGETTING] = growth * forgetting + (1.0 - growth) * final_forgetting
            if forgetting < 1.0:
                diagonal /= forgetting
            scalars[COUNT] += 1.0
            scalars[WEIGHT] = forgetting * scalars[WEIGHT] + 1.0
            scalars[WEIGHT_SQUARED] = forgetting**2 * scalars[WEIGHT_SQUARED] + 1.0
            memory = max(1.0 / scalars[WEIGHT], 1e-3 if walking else 0.0)
            scalars[VARIANCE] += memory * (error * error * forgetting / total - scalars[VARIANCE])
            for k in range(size):
                old[k] = theta[k]
            step = 1.0
            for halving in range(_HALVINGS + 1):
                for k in range(size):
                    theta[k] = old[k] + step * error * gain[k]
                if _predictor_stable(theta, na, nc, nd, nb, nf, radius):
                    break
                if halving == 0:
                    scalars[PROJECTED] += 1.0
                step = 0.0 if halving == _HALVINGS - 1 else 0.5 * step
            if len(carried):
                _carry(carried, gain, psi, step, most, work)
        elif not np.isfinite(y):
            y = predicted if np.isfinite(predicted) else 0.0
        if walking and scalars[COUNT] > 2.0 * size and scalars[VARIANCE] > 0.0:
            # One coefficient per sample, in turn: O(k^2), with the same random walk on average.
            index = int(scalars[TURN]) % size
            scalars[TURN] = float((index + 1) % size)
            add_variance(upper, diagonal, index, size * walk[index] / scalars[VARIANCE], work)
            if len(carried):
                carried[index, index] += size * walk[index] / scalars[VARIANCE]
        recorded = (offset + t + 1) % every == 0
        if recorded or forgets or walking:
            variances(upper, diagonal, variance)
        if forgets or walking:
            limit_variances(upper, diagonal, variance, most)
        if recorded:
            row = (offset + t) // every
            share = spread(scalars)
            for k in range(size):
                values[row, k] = theta[k]
                errors[row, k] = scalars[VARIANCE] * carried[k, k] if len(carried) else variance[k] * share
        # What goes into the memory is computed with the new coefficients.
        c, d = theta[first_c:first_d], theta[first_d:first_f]
        after = y
        for k in range(size):
            after -= theta[k] * phi[k]
        disturbance = y
        for k in range(na):
            disturbance += theta[k] * past[OUTPUT, k]
        place_b, place_f = na, first_f
        for i in range(m):
            base = INPUTS + ROWS_PER_INPUT * i
            plant = 0.0
            for k in range(nb[i]):
                plant += theta[place_b + k] * phi[place_b + k]
            for k in range(nf[i]):
                plant += theta[place_f + k] * phi[place_f + k]
            disturbance -= plant
            _push(past[base + PLANT], plant)
            f = theta[place_f : place_f + nf[i]]
            _remember(plant, f, c, d, past[base + PLANT_OVER_F], past[base + PLANT_FILTERED])
            place_b += nb[i]
            place_f += nf[i]
        filtered = y
        for k in range(nd):
            filtered += d[k] * past[OUTPUT, k]
        _push(past[OUTPUT_FILTERED], _recursive(filtered, past[OUTPUT_FILTERED], c))
        _push(past[OUTPUT], y)
        _push(past[noise + ERROR_FILTERED], _recursive(after, past[noise + ERROR_FILTERED], c))
        _push(past[noise + ERROR], after)
        _push(past[noise + DISTURBANCE_FILTERED], _recursive(disturbance, past[noise + DISTURBANCE_FILTERED], c))
        _push(past[noise + DISTURBANCE], disturbance)
