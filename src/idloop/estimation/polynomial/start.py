"""Where the search for a prediction-error estimate starts: by linear least squares alone."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from idloop.arrays import Array
from idloop.estimation.linear.least_squares import rows_in_blocks, triangle
from idloop.estimation.polynomial.instruments import by_command, four_steps, refined
from idloop.estimation.polynomial.order_selection import covering, factored, fit
from idloop.estimation.polynomial.polynomials import Orders, reflect
from idloop.estimation.polynomial.regression import (
    Channel,
    first_row,
    lagged,
    least_squares,
    regressors,
    residual_of,
    solution,
)

_LONG = (5, 10, 20, 40)  # orders of the long ARX model; Akaike's criterion chooses
_ROUNDS = 12  # of the Steiglitz-McBride iteration
_INSIDE = 0.98  # roots of C start inside this circle, so that the predictor forgets


def starts(data: Sequence[Channel], orders: Orders) -> list[Array]:
    """Coefficients to start the search from, of which at least one is usually close.

    A long ARX model gives innovations and impulse responses. Hannan and Rissanen's regression (Biometrika 69,
    1982) on the innovations gives A, B and C; the iteration of Steiglitz and McBride (IEEE Trans. Automatic
    Control 10, 1965) on the data and on the impulse responses gives B and F, and the noise model follows from
    what these leave.
    """
    innovations, responses = _long_model(data, orders)
    found = _separate(data, orders, responses) if any(orders.nf) else _shared(data, orders, innovations)
    return [_safe(one, orders) for one in found if np.all(np.isfinite(one))]


def shared_denominator(data: Sequence[Channel], orders: Orders) -> list[Array]:
    """A and B of the free run y = sum B_i / A u_i: first and last round of Steiglitz and McBride's iteration."""
    from scipy.signal import lfilter

    filtered, rounds = list(data), []
    for _ in range(_ROUNDS):
        coefficients = least_squares(filtered, orders).coefficients
        denominator = reflect(np.concatenate([[1.0], coefficients[orders.a]]))
        coefficients[orders.a] = denominator[1:]
        if not np.all(np.isfinite(coefficients)):
            break
        rounds.append(coefficients)
        if len(rounds) > 1 and np.allclose(rounds[-1], rounds[-2], rtol=1e-6, atol=0.0):
            break
        filtered = [
            Channel(lfilter([1.0], denominator, c.output), lfilter([1.0], denominator, c.inputs, axis=0)) for c in data
        ]
    return [rounds[0], rounds[-1]] if rounds else []


def noise_start(series: Sequence[Array], nc: int, nd: int) -> Array:
    """C and D of D v = C e from the series v, by Hannan and Rissanen's regression, shape (nc + nd,)."""
    silent = [Channel(s, np.zeros((len(s), 1))) for s in series]
    if nc + nd == 0:
        return np.zeros(0)
    orders = Orders(nd, (0,), nc, 0, (0,), (0,))
    innovations, _ = _long_model(silent, orders)
    joint = _with_innovations(silent, orders, innovations)
    return np.concatenate([joint[orders.c], joint[orders.a]])


def _shared(data: Sequence[Channel], orders: Orders, innovations: list[Array]) -> list[Array]:
    """Starts in which the whole dynamics is in A."""
    plain = Orders.of(na=orders.na, nb=orders.nb, nk=orders.nk)
    found = []
    extended = Orders(orders.na, orders.nb, orders.nc, 0, (0,) * orders.inputs, orders.nk)
    if orders.nc:
        joint = _with_innovations(data, extended, innovations)
        found.append(_placed(orders, extended, joint))
    candidates = [least_squares(data, plain).coefficients]
    if any(orders.nb) and orders.na:
        candidates.append(four_steps(data, plain, by_command(data, plain))[0])
        candidates.append(refined(data, plain, candidates[-1]))
    for candidate in candidates:
        series = [residual_of(c, plain, candidate, first_row(plain)) for c in data]
        start = _placed(orders, plain, candidate)
        noise = noise_start(series, orders.nc, orders.nd)
        start[orders.c], start[orders.d] = noise[: orders.nc], noise[orders.nc :]
        found.append(start)
    return found


def _separate(data: Sequence[Channel], orders: Orders, responses: list[Array]) -> list[Array]:
    """Starts in which each input has a denominator of its own, and A is 1."""
    found = []
    reduced = [_reduced(response, orders, i) for i, response in enumerate(responses)]
    plants = [reduced, _backfitted(data, orders, reduced)]
    plants.append(_backfitted(data, orders, plants[1], instrumental=True))
    plain = Orders(max(orders.nf), orders.nb, 0, 0, (0,) * orders.inputs, orders.nk)
    if orders.inputs > 1 and len(set(orders.nf)) == 1 and any(orders.nb):
        rounds = shared_denominator(data, plain)
        instrumental = four_steps(data, plain, by_command(data, plain))[0]
        alike = [*rounds, instrumental, refined(data, plain, instrumental)]
        plants += [[(one[plain.b(i)], one[plain.a]) for i in range(orders.inputs)] for one in alike]
    for plant in plants:
        start = np.zeros(orders.size)
        for i, (numerator, denominator) in enumerate(plant):
            start[orders.b(i)] = numerator
            start[orders.f(i)] = reflect(np.concatenate([[1.0], denominator]))[1:]
        if orders.nc or orders.nd:
            series = [c.output - sum(_driven(c, orders, i, start) for i in range(orders.inputs)) for c in data]
            noise = noise_start(series, orders.nc, orders.nd)
            start[orders.c], start[orders.d] = noise[: orders.nc], noise[orders.nc :]
        found.append(start)
    return found


def _driven(channel: Channel, orders: Orders, index: int, coefficients: Array) -> Array:
    from scipy.signal import lfilter

    numerator = np.concatenate([np.zeros(orders.nk[index]), coefficients[orders.b(index)], [0.0]])
    return np.asarray(
        lfilter(numerator, np.concatenate([[1.0], coefficients[orders.f(index)]]), channel.inputs[:, index])
    )


def _reduced(response: Array, orders: Orders, index: int) -> tuple[Array, Array]:
    """B and F of one input from an impulse response."""
    nb, nf, nk = orders.nb[index], orders.nf[index], orders.nk[index]
    if nb == 0:
        return np.zeros(0), np.zeros(nf)
    pulse = np.zeros(len(response))
    pulse[0] = 1.0
    # Zeros in front stand for the plant at rest before the pulse.
    rest = np.zeros(nf + nb + nk)
    channel = Channel(np.concatenate([rest, response]), np.concatenate([rest, pulse])[:, None])
    return _iterated([channel], nb, nf, nk)


def _iterated(
    data: Sequence[Channel], nb: int, nf: int, nk: int, start: tuple[Array, Array] | None = None
) -> tuple[Array, Array]:
    """B and F of one input by Steiglitz and McBride's iteration, or from a start by refined instruments."""
    single = Orders(nf, (nb,), 0, 0, (0,), (nk,))
    if start is not None:
        last = refined(data, single, np.concatenate([start[1], start[0]]))
    else:
        rounds = shared_denominator(data, single)
        last = rounds[-1] if rounds else np.zeros(single.size)
    return last[single.b(0)], last[single.a]


def _backfitted(
    data: Sequence[Channel], orders: Orders, plant: list[tuple[Array, Array]], *, instrumental: bool = False
) -> list[tuple[Array, Array]]:
    """Iterations on the data, for one input after the other."""
    from scipy.signal import lfilter

    plant = list(plant)
    for _ in range(2 if orders.inputs > 1 else 1):
        for i in range(orders.inputs):
            if not orders.nb[i]:
                continue
            alone = []
            for channel in data:
                target = channel.output.copy()
                for j, (numerator, denominator) in enumerate(plant):
                    if j != i and orders.nb[j]:
                        top = np.concatenate([np.zeros(orders.nk[j]), numerator])
                        bottom = reflect(np.concatenate([[1.0], denominator]))
                        target -= lfilter(top, bottom, channel.inputs[:, j])
                alone.append(Channel(target, channel.inputs[:, [i]]))
            begin = plant[i] if instrumental else None
            plant[i] = _iterated(alone, orders.nb[i], orders.nf[i], orders.nk[i], begin)
    return plant


def _long_model(data: Sequence[Channel], orders: Orders) -> tuple[list[Array], list[Array]]:
    """Innovations (0 where the past is not known) and impulse responses of a long ARX model."""
    from scipy.signal import lfilter

    inputs = [i for i in range(orders.inputs) if orders.nb[i]]
    shortest = max([orders.na, orders.nc, orders.nd, *orders.nf, *orders.nb])
    rows = sum(len(c.output) for c in data)
    lengths = [n for n in sorted({*_LONG, 2 * shortest}) if n >= shortest and n * (1 + len(inputs)) < rows / 8]
    if not lengths:
        lengths = [shortest]
    sizes = [_long_orders(orders, length) for length in lengths]
    longest = covering(sizes)
    factor, rows = factored(data, longest)
    fits = [fit(factor, size, longest) for size in sizes]
    criteria = [
        rows * np.log(max(one.squares, 1e-300)) + 2.0 * size.size for one, size in zip(fits, sizes, strict=True)
    ]
    place = int(np.argmin(criteria))
    size, coefficients = sizes[place], fits[place].coefficients
    begin = first_row(size)
    innovations = [np.concatenate([np.zeros(min(begin, len(c.output))), residual_of(c, size, coefficients, begin)])
                   for c in data]  # fmt: skip
    pulse = np.zeros(4 * size.na + 100)
    pulse[0] = 1.0
    denominator = np.concatenate([[1.0], coefficients[size.a]])
    responses = [
        lfilter(np.concatenate([np.zeros(size.nk[i]), coefficients[size.b(i)], [0.0]]), denominator, pulse)
        for i in range(orders.inputs)
    ]
    return innovations, responses


def _long_orders(orders: Orders, length: int) -> Orders:
    nb = tuple(length if nb else 0 for nb in orders.nb)
    return Orders.of(na=length, nb=nb, nk=orders.nk)


def _with_innovations(data: Sequence[Channel], orders: Orders, innovations: list[Array]) -> Array:
    """Least squares of A y = B u + (C - 1) e + e with estimated innovations in the place of e."""
    first = first_row(orders) + orders.nc
    # Where the long model does not reach back, its innovations are not known.
    begin = max(first, *(int(np.argmax(i != 0.0)) + orders.nc for i in innovations))
    blocks = (
        np.hstack(
            [
                regressors(c, orders, start, stop),
                lagged(e, range(1, orders.nc + 1), start, stop),
                c.output[start:stop, None],
            ]
        )
        for c, e in zip(data, innovations, strict=True)
        for start, stop in rows_in_blocks(len(c.output), begin)
    )
    return solution(triangle(blocks)).coefficients


def _placed(orders: Orders, smaller: Orders, coefficients: Array) -> Array:
    """Coefficients of A, B and C in a larger structure."""
    start = np.zeros(orders.size)
    start[orders.a] = coefficients[smaller.a]
    for i in range(orders.inputs):
        start[orders.b(i)] = coefficients[smaller.b(i)]
    if smaller.nc:
        start[orders.c] = coefficients[smaller.c]
    return start


def _safe(start: Array, orders: Orders) -> Array:
    start = start.copy()
    start[orders.c] = reflect(np.concatenate([[1.0], start[orders.c]]), _INSIDE)[1:]
    for i in range(orders.inputs):
        start[orders.f(i)] = reflect(np.concatenate([[1.0], start[orders.f(i)]]))[1:]
    return start
