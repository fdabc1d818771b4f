"""Feedback in a record, by its reference or by the noise of the outputs in its command, and its exogenous signals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from idloop.arrays import Array
from idloop.errors import IdloopError
from idloop.estimation.black_box.sampled import SampledData, held_sum, sampled, together

if TYPE_CHECKING:
    from idloop.estimation.black_box.method import Choices, Method
    from idloop.records import Record


_LAGS = 20  # of the regressions
_ROWS = 20_000  # most samples for the regressions
_SURE = 1e-6  # p-value below which the command depends on the noise
_DOUBT = 0.01  # p-value below which feedback is possible
_SHARE = 0.02  # least part of the command's innovation that the noise explains: a nonlinear plant may imitate less
_LEAST = 5e-3  # the same of the command's power without a reference: any signal predicts a smooth command so well
_ROUNDING = 1e-13  # relative eigenvalue of the normal equations that counts as zero
_DIGITS = 1e-7  # relative accuracy of the normal equations
_INSIDE = 1e-6  # least distance of a root from the unit circle
_PREDICTED = 1e-8  # part of the command's power below which its innovation is rounding
# Columns of the position reference, and of the excitation of the command.
_COLUMNS = ((("reference", 0), ("excitation", 0)), (("excitation", 1),))


@dataclass(frozen=True)
class Loop:
    """Feedback in the loop of a record."""

    reference: bool  # whether a reference is recorded and changes
    fed_back: float  # share of the command's power due to the noise of the outputs; NaN for too few samples
    p_value: float  # probability of such a share without feedback
    depends: bool  # whether the command depends significantly on the noise of the outputs

    @property
    def closed(self) -> bool:
        """Whether the loop counts as closed."""
        return self.reference or self.depends

    @property
    def possible(self) -> bool:
        """Whether feedback cannot be ruled out."""
        return self.reference or self.p_value < _DOUBT

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers for JSON."""
        return {"closed": self.closed, "reference_moves": self.reference, "depends_on_noise": self.depends,
                "fed_back": self.fed_back, "p_value": self.p_value}  # fmt: skip


def detect_feedback(data: SampledData | Sequence[SampledData]) -> Loop:
    """Detect feedback by whether the outputs' innovations help to predict the command.

    In an open loop the innovations, errors of a long ARX model, do not (Ljung, 2nd ed., sections 13.4 and 16.5). With a
    recorded reference those of the same sample are included; without one they are not, as a measurement with a late
    stamp has the same effect.

    `data`: the first input is the command.
    """
    experiments = together(data)
    reference = all(one.reference is not None for one in experiments) and any(
        np.ptp(one.reference) > 0.0 for one in experiments if one.reference is not None and len(one)
    )
    unknown = Loop(reference, float("nan"), 1.0, False)
    used = [one.part(0, max(_ROWS * len(one) // max(sum(map(len, experiments)), _ROWS), 1)) for one in experiments]
    known: list[Array] = []
    innovations: list[Array] = []
    target: list[Array] = []
    noise: list[Array] = []
    for one, errors in zip(used, _innovations(used), strict=True):
        if errors is None:
            continue
        first, last = 2 * _LAGS, len(one)
        command = one.input[:, :1] - np.mean(one.input[:, :1])
        columns = [np.ones((last - first, 1)), _past(command, 1, first)]
        if reference and one.reference is not None:
            columns.append(_past(one.reference[:, None], 0, first))
        known.append(np.hstack(columns))
        # Row t of the errors is that of sample t + _LAGS.
        innovations.append(_past(errors, 0 if reference else 1, _LAGS))
        target.append(command[first:, 0])
        noise.append(errors)
    if not target or sum(map(len, target)) < 4 * (known[0].shape[1] + innovations[0].shape[1]):
        return unknown
    wanted, plain, added = np.concatenate(target), np.vstack(known), np.vstack(innovations)
    left, _ = _least_squares(plain, wanted)
    rest, weights = _least_squares(np.hstack([plain, added]), wanted)
    power, before, after = (float(part @ part) for part in (wanted, left, rest))
    if not before > _PREDICTED * power:
        return unknown
    from scipy.special import fdtrc

    extra, degrees = added.shape[1], len(wanted) - plain.shape[1] - added.shape[1]
    ratio = ((before - after) / extra) / max(after / degrees, 1e-300)
    p_value = float(fdtrc(extra, degrees, ratio))
    # Without the part that so many columns explain by chance.
    explained = max(before - after - extra * after / degrees, 0.0)
    sure = p_value < _SURE and explained > max(_SHARE * before, 0.0 if reference else _LEAST * power)
    share = explained / power
    if p_value < _DOUBT:
        # First a constant and the command's own past, last the innovations from the newest on.
        answer = weights[plain.shape[1] :].reshape(-1, experiments[0].output.shape[1])
        back = _returned(weights[1 : 1 + _LAGS], answer if reference else np.vstack([0.0 * answer[:1], answer]), noise)
        share = min(max(share, back / power), 1.0)
    return Loop(reference, share, p_value, sure)


def feedback_possible(record: Record) -> bool:
    """Whether the command of a record follows a reference, or may depend on the noise of the outputs.

    False for a record too short, or with too many gaps, to decide.
    """
    try:
        return detect_feedback(sampled(record)).possible
    except IdloopError:
        return False


def exogenous_signals(record: Record, time: Array) -> list[Array]:
    """Recorded exogenous signals that change, at given times (n,) [s]: position reference and command excitation."""
    sums = [held_sum(record, time, *columns) for columns in _COLUMNS]
    return [one for one in sums if one is not None and np.ptp(one) > 0.0]


def handles_feedback(method: Method, choices: Choices) -> bool:
    """Whether a method with these choices is consistent under feedback."""
    if method.loop.startswith("open"):
        return "closed_loop" in method.needs and choices.closed_loop
    # The error of a free run depends on a command that contains it.
    return not ("focus" in method.needs and choices.focus == "simulation")


def closed_loop_methods(loop: Loop) -> tuple[str, ...]:
    """Options of the methods that are consistent under feedback."""
    by_reference = ("iv4 --closed-loop", "indirect") if loop.reference else ()
    return ("pbsid", "pem", "bj", "armax", "arx of high order", *by_reference, "vodma --controller FILE")


def _innovations(data: Sequence[SampledData]) -> list[Array | None]:
    """Errors of a long ARX model of all outputs from sample `_LAGS` on; None for a record that is too short."""
    long = [one if len(one) > 3 * _LAGS else None for one in data]
    kept = [one for one in long if one is not None]
    if not kept:
        return [None for _ in data]
    rows = [
        np.hstack([np.ones((len(one) - _LAGS, 1)), _past(one.output, 1, _LAGS), _past(one.input, 1, _LAGS)])
        for one in kept
    ]
    targets = np.vstack([one.output[_LAGS:] for one in kept])
    errors, _ = _least_squares(np.vstack(rows), targets)
    # Errors below the accuracy of the normal equations are rounding.
    errors[:, np.std(errors, axis=0) < _DIGITS * np.std(targets, axis=0)] = 0.0
    following = iter(np.split(errors, np.cumsum([len(part) for part in rows])[:-1]))
    return [None if one is None else next(following) for one in long]


def _past(signals: Array, least: int, first: int) -> Array:
    """Columns of all signals `least` to `_LAGS` samples ago, from the row `first` on."""
    return np.hstack([signals[first - lag : len(signals) - lag] for lag in range(least, _LAGS + 1)])


def _returned(own: Array, answer: Array, noise: Sequence[Array]) -> float:
    """Power of the command due to the noise, as it passes the loop.

    `own` (k,): coefficients of the command's past, 1 to k samples ago; `answer` (l, p): coefficients of the
    innovations, 0 to l - 1 samples ago; `noise` (n, p): innovations.
    """
    from scipy.signal import lfilter

    roots = np.roots(np.r_[1.0, -own])
    # Unstable roots are errors of the estimate: reflect them.
    roots = np.where(np.abs(roots) > 1.0, 1.0 / np.conj(roots), roots) * (1.0 - _INSIDE)
    denominator = np.real(np.poly(roots))
    power = 0.0
    for innovations in noise:
        pairs = zip(answer.T, innovations.T, strict=True)
        command = np.sum([lfilter(weights, denominator, one) for weights, one in pairs], axis=0)[_LAGS:]
        power += float(command @ command)
    return power


def _least_squares(rows: Array, target: Array) -> tuple[Array, Array]:
    """Residual and coefficients of a least-squares problem by normal equations, which are accurate enough here."""
    scale = np.linalg.norm(rows, axis=0)
    scaled = rows / np.where(scale > 0.0, scale, 1.0)
    solution = np.linalg.lstsq(scaled.T @ scaled, scaled.T @ target, rcond=_ROUNDING)[0]
    weights = (solution.T / np.where(scale > 0.0, scale, 1.0)).T
    return np.asarray(target - scaled @ solution), np.asarray(weights)
