"""Levenberg-Marquardt training of a network, stopped early by validation data.

The rules of damping and stopping are those of paper and toolbox (Hagan and Menhaj, IEEE Trans. Neural Networks 5,
1994): the damping mu is lowered after each step that helps and raised until one does. Unlike the bounded search
for physical parameters, it has slopes in closed form, no box, and ends where the validation error turns.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from idloop.arrays import Array
from idloop.errors import InputError
from idloop.estimation.linear.least_squares import triangle
from idloop.estimation.networks.network import Network, ahead, parameters, slopes, with_parameters
from idloop.estimation.networks.training_data import BLOCK, TrainingData

_SMALLEST_DAMPING = 1e-20


@dataclass(frozen=True)
class TrainingRules:
    """When to step and when to stop.

    Raises InputError: numbers out of range.
    """

    epochs: int = 1000  # most steps
    goal: float = 0.0  # mean square of the scaled training errors that is good enough
    min_gradient: float = 1e-7  # norm of the gradient of that mean square at which nothing is left to gain
    # Epochs in a row without a better validation error; without validation data, without a gain in training
    max_fail: int = 6
    # Share of the training error by which a step without validation data must lower it: what is left to gain then is
    # noise
    min_gain: float = 5e-4
    # Damping at the start, its factors after good and bad steps, and where to give up
    mu: float = 1e-3
    mu_decrease: float = 0.1
    mu_increase: float = 10.0
    mu_max: float = 1e10

    def __post_init__(self) -> None:
        if self.epochs < 0 or self.max_fail < 1:
            raise InputError(f"{self.epochs} epochs, {self.max_fail} validation checks; give 0 or more and 1 or more")
        if not 0 <= self.min_gain < 1:
            raise InputError(f"gain of {self.min_gain:g} of the training error; give a share, 0 or more and below 1")
        if not (0 < self.mu <= self.mu_max and 0 < self.mu_decrease < 1 < self.mu_increase):
            raise InputError(
                f"mu = {self.mu:g} with factors {self.mu_decrease:g} and {self.mu_increase:g}; take mu above 0,"
                " a decrease below 1 and an increase above 1"
            )


@dataclass(frozen=True, eq=False)
class TrainingHistory:
    """Course of a training."""

    # shape (e + 1,): mean squares of the scaled errors after each step, the start first; NaN where there are no such
    # samples
    train: Array
    validation: Array
    test: Array
    # shape (e + 1,): norm of the gradient and damping; NaN where none was needed
    gradient: Array
    mu: Array
    best: int  # step whose network was kept
    stop: str  # why it ended
    step: str = "epoch"  # one of `epoch`, `unit`: what a step is: one of Levenberg-Marquardt, or one more unit selected


def errors(network: Network, data: TrainingData, parallel: bool) -> Array:
    """Measured outputs less the network's, scaled, shape (n, p): of its free run, or one step ahead."""
    found = []
    for inputs, outputs, _ in data.pieces():
        with np.errstate(over="ignore", invalid="ignore"):
            error = (outputs - _modelled(network, data, inputs, outputs, parallel)) / network.output_width
        found.append(error[data.first :])
    return np.concatenate(found)


def mean_squares(network: Network, data: TrainingData, parallel: bool) -> Array:
    """Mean squares of the scaled errors over training, validation and test, shape (3,); NaN where there is none."""
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        scaled = errors(network, data, parallel)
        count = np.bincount(data.purpose, minlength=3) * scaled.shape[1]
        total = np.array([np.sum(scaled[data.purpose == one] ** 2) for one in range(3)])
        return np.asarray(np.where(count > 0, total / count, np.nan))


def _modelled(network: Network, data: TrainingData, inputs: Array, outputs: Array, parallel: bool) -> Array:
    free = np.full(len(network.constant), np.inf)
    return np.asarray(ahead(network, inputs, outputs, data.first, len(outputs) if parallel else 1, -free, free))


def _rows(network: Network, data: TrainingData, parallel: bool, with_linear: bool) -> Iterator[Array]:
    """Blocks of the columns (slopes in the order of `parameters`, scaled error) of the training samples."""
    p, size = len(network.constant), parameters(network, with_linear).size
    for inputs, outputs, purpose in data.pieces():
        modelled = _modelled(network, data, inputs, outputs, parallel)
        left = (outputs - modelled) / network.output_width
        past = modelled if parallel else outputs
        carry = np.zeros((max(data.first, 1), p, size))
        for begin in range(data.first, len(outputs), BLOCK):
            end = min(begin + BLOCK, len(outputs))
            found = slopes(network, with_linear, inputs, past, begin, end, carry, parallel)
            used = purpose[begin - data.first : end - data.first] == 0
            yield np.column_stack([found[used].reshape(-1, size), left[begin:end][used].ravel()])


def train(
    network: Network, data: TrainingData, rules: TrainingRules, *, parallel: bool = False, with_linear: bool = False
) -> tuple[Network, TrainingHistory]:
    """Train all adjustable numbers of a network."""
    point, mu = parameters(network, with_linear), rules.mu
    now = mean_squares(network, data, parallel)
    best, best_point, best_error, fails = 0, point, now[1], 0
    rows = [[*now, np.nan, mu]]
    stop = f"{rules.epochs} epochs"
    if not np.isfinite(now[0]):
        # A free run that overflows has no slope to follow.
        return network, _history(rows, 0, "the free run diverges at the start")
    for epoch in range(1, rules.epochs + 1):
        if now[0] <= rules.goal:
            stop = "goal"
            break
        factor = _factor(with_parameters(network, point, with_linear), data, parallel, with_linear)
        if not np.all(np.isfinite(factor)):
            stop = "the slopes overflow"
            break
        left, sizes, right = np.linalg.svd(factor[:, :-1], full_matrices=False)
        along = left.T @ factor[:, -1]
        gradient = 2.0 * float(np.linalg.norm(sizes * along))
        rows[-1][3] = gradient
        if gradient < rules.min_gradient:
            stop = "gradient"
            break
        while mu <= rules.mu_max:
            # The damped step (J'J + mu I)^-1 J'e without forming J'J.
            trial = point + right.T @ (sizes / (sizes**2 + mu) * along)
            then = mean_squares(with_parameters(network, trial, with_linear), data, parallel)
            if then[0] < now[0]:
                break
            mu *= rules.mu_increase
        else:
            stop = "damping"
            break
        gained = now[0] - then[0] >= rules.min_gain * now[0]
        point, now = trial, then
        mu = max(mu * rules.mu_decrease, _SMALLEST_DAMPING)
        rows.append([*now, np.nan, mu])
        if np.isnan(now[1]):
            best, best_point = epoch, point
            fails = 0 if gained else fails + 1
            if fails >= rules.max_fail:
                stop = "gain"
                break
        elif not np.isfinite(best_error) or now[1] < best_error:
            best, best_point, best_error, fails = epoch, point, now[1], 0
        else:
            fails += 1
            if fails >= rules.max_fail:
                stop = "validation"
                break
    return with_parameters(network, best_point, with_linear), _history(rows, best, stop)


def _history(rows: list[list[float]], best: int, stop: str) -> TrainingHistory:
    table = np.array(rows, dtype=float)
    return TrainingHistory(table[:, 0], table[:, 1], table[:, 2], table[:, 3], table[:, 4], best, stop)


def _factor(network: Network, data: TrainingData, parallel: bool, with_linear: bool) -> Array:
    """Triangular factor of slopes and scaled errors of the training samples, over the root of their number.

    By QR of one block after another, so that neither the memory grows with the record nor the condition is squared.
    """
    rows = int(np.sum(data.purpose == 0)) * len(network.constant)
    return np.asarray(triangle(_rows(network, data, parallel, with_linear)) / np.sqrt(max(rows, 1)))
