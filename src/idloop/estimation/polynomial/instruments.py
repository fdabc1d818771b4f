"""ARX coefficients by instrumental variables, which no colour of the noise biases."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from idloop.arrays import Array, Mask
from idloop.errors import InputError
from idloop.estimation.black_box.prefilter import Filter, prefiltered
from idloop.estimation.black_box.sampled import SampledData, together
from idloop.estimation.linear.least_squares import column_sizes, solve
from idloop.estimation.polynomial.model import Fitted, PolynomialModel, fit_outputs
from idloop.estimation.polynomial.polynomials import Orders, reflect
from idloop.estimation.polynomial.regression import (
    Channel,
    first_row,
    inverse_factor,
    least_squares,
    regressors,
    residual_of,
    white_errors,
)

_LONG = 20  # order of the models that make the instruments


def iv4(
    data: SampledData | Sequence[SampledData],
    na: int,
    nb: int | Sequence[int],
    nk: int | Sequence[int] = 1,
    *,
    instruments: Literal["command", "reference"] = "command",
    prefilter: Filter | None = None,
) -> PolynomialModel:
    """Estimate B_i / A by Ljung's four-step method with approximately optimal instruments.

    The instruments are the noise-free outputs that the commands alone cause in a long ARX model, so the estimate is
    consistent in noise of any colour in open loop. An ARX model of the order asked for, as in the book, is so biased
    in sensor noise that its outputs may have nothing to do with the plant's. Under feedback the commands carry the
    noise, and the estimate is biased; there the part of commands and outputs that the reference causes serves
    instead, whatever the controller.

    Parameters
    ----------
    na : int
        Degree of A, common to all inputs.
    nb, nk : int or one per input
        Number of coefficients of B and lag of the first [samples].
    instruments : "command" or "reference"
        What they are made from; the reference for closed loops, where the data must hold it.
    prefilter : (numerator, denominator) or discrete python-control system, optional
        Filter that weighs frequencies.

    Returns
    -------
    PolynomialModel
        With 1 / A as noise model; `variance` of its polynomials is that of the whitened equation error.

    Raises
    ------
    InputError
        Orders that do not suit the signals, too few samples, an input that never moves, or no reference.

    References
    ----------
    Ljung, System Identification, 2nd ed., eq. 15.21 to 15.26; covariance of the optimal instruments eq. 9.72;
    closed loop: Gilson and Van den Hof, Automatica 41, 2005.
    """
    experiments = together(data)
    m = experiments[0].input.shape[1]
    orders = Orders.of(m, na=na, nb=nb, nk=nk)
    if not any(orders.nb):
        raise InputError("iv4: nb is 0 for every input; the instruments come from the commands, give nb at least 1")
    weighted, first = prefiltered(experiments, prefilter), first_row(orders)

    def fit(signals: list[Channel], measured: list[Channel], _: int) -> Fitted:
        clean = _by_reference(weighted, signals) if instruments == "reference" else by_command(signals, orders)
        coefficients, factor, variance, undetermined = four_steps(signals, orders, clean)
        residuals = [residual_of(c, orders, coefficients, first) for c in measured]
        covariance = white_errors(factor, variance, undetermined)
        return Fitted(coefficients, covariance, undetermined, residuals, variance)

    return fit_outputs("iv4", experiments, orders, prefilter, fit)


def four_steps(data: Sequence[Channel], orders: Orders, clean: Sequence[Channel]) -> tuple[Array, Array, float, Mask]:
    """Instruments, the solution by them, whitening of what is left, instruments again.

    `clean`: signals without noise to make the instruments from. Returns `coefficients` (k,); `factor` (k, r): W with
    covariance `variance` W W^T; `variance`: of the whitened equation errors; `undetermined` (k,).
    """
    from scipy.signal import lfilter

    first = first_row(orders)
    begun, _, _ = _instrumental(data, clean, orders, np.ones(1), first)
    whitener = _autoregression([residual_of(c, orders, begun, first) for c in data], orders.na + max(orders.nb))
    coefficients, factor, undetermined = _instrumental(data, clean, orders, whitener, first)
    errors = [lfilter(whitener, [1.0], residual_of(c, orders, coefficients, first))[len(whitener) :] for c in data]
    degrees = max(sum(map(len, errors)) - orders.size, 1)
    return coefficients, factor, float(sum(e @ e for e in errors)) / degrees, undetermined


def refined(data: Sequence[Channel], orders: Orders, start: Array, rounds: int = 10) -> Array:
    """Simplified refined instrumental variables: B / A of the free run, whatever the colour of the noise.

    Young, Recursive Estimation and Time-Series Analysis, 2nd ed., section 7.4: instruments and signals go
    through 1 / A, and all is repeated until A stays.
    """
    first = first_row(orders)
    coefficients = start.copy()
    for _ in range(rounds):
        denominator = reflect(np.concatenate([[1.0], coefficients[orders.a]]))
        clean = _caused(data, orders, coefficients)
        following, _, _ = _instrumental(data, clean, orders, np.ones(1), first, denominator)
        if not np.all(np.isfinite(following)):
            break
        following[orders.a] = reflect(np.concatenate([[1.0], following[orders.a]]))[1:]
        settled = np.allclose(following, coefficients, rtol=1e-6, atol=0.0)
        coefficients = following
        if settled:
            break
    return np.asarray(coefficients)


def _instrumental(
    data: Sequence[Channel],
    clean: Sequence[Channel],
    orders: Orders,
    whitener: Array,
    first: int,
    damper: Array | None = None,
) -> tuple[Array, Array, Mask]:
    """Solve sum zeta(t) [y(t) - phi(t)^T theta] = 0 with noise-free signals in zeta, all through whitener / damper."""
    from scipy.signal import lfilter

    below = np.ones(1) if damper is None else damper
    instruments, rows, targets = [], [], []
    skip = first + (len(whitener) - 1 if first else 0)
    for channel, source in zip(data, clean, strict=True):
        filtered, noise_free = (
            Channel(lfilter(whitener, below, c.output), lfilter(whitener, below, c.inputs, axis=0))
            for c in (channel, source)
        )
        instruments.append(regressors(noise_free, orders, skip, len(channel.output)))
        rows.append(regressors(filtered, orders, skip, len(channel.output)))
        targets.append(filtered.output[skip:])
    if sum(map(len, targets)) <= orders.size:
        raise InputError(
            f"{sum(map(len, targets))} usable samples for {orders.size} coefficients; record longer or lower the orders"
        )
    zeta = np.vstack(instruments)
    scale = column_sizes(zeta)
    # Orthonormal instruments span the same equations without squaring their condition number.
    basis, triangle = np.linalg.qr(zeta / scale)
    left, right = basis.T @ np.vstack(rows), basis.T @ np.concatenate(targets)
    factor, undetermined = inverse_factor(triangle * scale)
    return solve(left, right, 1e-13 * orders.size), factor, undetermined


def _caused(data: Sequence[Channel], orders: Orders, coefficients: Array) -> list[Channel]:
    """Commands, and the outputs that they alone cause in a model."""
    from scipy.signal import lfilter

    # An unstable model would make instruments that grow without bound; mirrored roots serve as well.
    denominator = reflect(np.concatenate([[1.0], coefficients[orders.a]]))
    caused = []
    for channel in data:
        output = np.zeros(len(channel.output))
        for i, (nb, nk) in enumerate(zip(orders.nb, orders.nk, strict=True)):
            if nb:
                numerator = np.concatenate([np.zeros(nk), coefficients[orders.b(i)]])
                output += lfilter(numerator, denominator, channel.inputs[:, i])
        caused.append(Channel(output, channel.inputs))
    return caused


def by_command(signals: Sequence[Channel], orders: Orders) -> list[Channel]:
    """Commands, and the outputs that they alone cause, by an ARX model at least as long as the one asked for."""
    usual = _usual_length(signals)
    degrees = tuple(max(usual, nb) if nb else 0 for nb in orders.nb)
    longer = Orders.of(na=max(usual, orders.na), nb=degrees, nk=orders.nk)
    return _caused(signals, longer, least_squares(signals, longer).coefficients)


def _by_reference(data: Sequence[SampledData], signals: Sequence[Channel]) -> list[Channel]:
    """Commands and outputs that the reference alone causes, by long ARX models from it to each."""
    references = [one.reference for one in data if one.reference is not None and np.any(one.reference)]
    if len(references) < len(data):
        raise InputError(
            f"{data[0].name}: no reference that moves; record it, or make the instruments from the command (open loop)"
        )
    length = _usual_length(signals)
    orders = Orders.of(na=length, nb=length, nk=0)
    columns = []
    for column in range(-1, signals[0].inputs.shape[1]):
        targets = [c.output if column < 0 else c.inputs[:, column] for c in signals]
        pairs = [Channel(y, r[:, None]) for y, r in zip(targets, references, strict=True)]
        caused = _caused(pairs, orders, least_squares(pairs, orders).coefficients)
        columns.append([c.output for c in caused])
    return [Channel(parts[0], np.column_stack(parts[1:])) for parts in zip(*columns, strict=True)]


def _usual_length(signals: Sequence[Channel]) -> int:
    return min(_LONG, max(min(len(c.output) for c in signals) // 10, 1))


def _autoregression(series: Sequence[Array], order: int) -> Array:
    """Polynomial 1 + l1 q^-1 + ... that whitens equation errors, over all experiments."""
    silent = [Channel(s, np.zeros((len(s), 1))) for s in series]
    orders = Orders.of(na=order, nk=0)
    return np.concatenate([[1.0], least_squares(silent, orders).coefficients])
