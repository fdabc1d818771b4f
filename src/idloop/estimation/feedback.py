"""Whether a record was made in a closed loop: its reference, and what of the outputs' noise its command holds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from idloop.estimation.black_box.sampled import SampledData, together

if TYPE_CHECKING:
    from idloop.estimation.black_box.method import Choices, Method

Array = NDArray[np.float64]

_LAGS = 20  # samples that the regressions look back
_ROWS = 20_000  # that are enough for them
_SURE = 1e-6  # probability below which chance is ruled out
_DOUBT = 0.01  # and below which it is not held for chance either
_SHARE = 0.02  # of a command's news that noise must explain: less, and a nonlinear plant could feign it
_LEAST = 5e-3  # of a command's power without a reference: a smooth command can be told so well from any signal
_ROUNDING = 1e-13  # of the largest eigenvalue of normal equations: less is none of the data's
_DIGITS = 1e-7  # of an output that normal equations keep
_INSIDE = 1e-6  # that a root lies within the unit circle at least
_NEWS = 1e-8  # of a command's power: less is rounding of a command that is known ahead


@dataclass(frozen=True)
class Loop:
    """What the data tell of the loop that they were made in.

    Attributes
    ----------
    reference : bool
        Whether a reference is recorded and moves.
    fed_back : float
        Share of the command's power that the noise of the outputs makes, as it comes back through the loop; NaN where
        too few samples tell.
    p_value : float
        Probability of so much by chance.
    depends : bool
        Whether the command is sure to depend on the noise of the outputs.
    """

    reference: bool
    fed_back: float
    p_value: float
    depends: bool

    @property
    def closed(self) -> bool:
        """Whether the loop counts as closed."""
        return self.reference or self.depends

    @property
    def possible(self) -> bool:
        """Whether feedback cannot be ruled out: there is a reference, or a trace of noise in the command."""
        return self.reference or self.p_value < _DOUBT

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers for JSON."""
        return {"closed": self.closed, "reference_moves": self.reference, "depends_on_noise": self.depends,
                "fed_back": self.fed_back, "p_value": self.p_value}  # fmt: skip


def loop_of(data: SampledData | Sequence[SampledData]) -> Loop:
    """Tell open from closed loop by whether errors of the outputs' prediction help to predict the command.

    The outputs' news (errors of a long ARX model) cannot come back in a command that does not depend on them (Ljung,
    2nd ed., sections 13.4 and 16.5). Beside a recorded reference the news of the same sample counts as well; without
    one it does not, because a measurement that is stamped late looks alike.

    Parameters
    ----------
    data : SampledData or sequence of SampledData
        The first input is the command.
    """
    experiments = together(data)
    reference = all(one.reference is not None for one in experiments) and any(
        np.ptp(one.reference) > 0.0 for one in experiments if one.reference is not None and len(one)
    )
    nothing = Loop(reference, float("nan"), 1.0, False)
    used = [one.part(0, max(_ROWS * len(one) // max(sum(map(len, experiments)), _ROWS), 1)) for one in experiments]
    known: list[Array] = []
    news: list[Array] = []
    target: list[Array] = []
    noise: list[Array] = []
    for one, errors in zip(used, _news(used), strict=True):
        if errors is None:
            continue
        first, last = 2 * _LAGS, len(one)
        command = one.input[:, :1] - np.mean(one.input[:, :1])
        columns = [np.ones((last - first, 1)), _past(command, 1, first)]
        if reference and one.reference is not None:
            columns.append(_past(one.reference[:, None], 0, first))
        known.append(np.hstack(columns))
        # Row t of the errors is that of sample t + _LAGS.
        news.append(_past(errors, 0 if reference else 1, _LAGS))
        target.append(command[first:, 0])
        noise.append(errors)
    if not target or sum(map(len, target)) < 4 * (known[0].shape[1] + news[0].shape[1]):
        return nothing
    wanted, plain, added = np.concatenate(target), np.vstack(known), np.vstack(news)
    left, _ = _left(plain, wanted)
    rest, weights = _left(np.hstack([plain, added]), wanted)
    power, before, after = (float(part @ part) for part in (wanted, left, rest))
    if not before > _NEWS * power:
        return nothing
    from scipy.special import fdtrc

    extra, degrees = added.shape[1], len(wanted) - plain.shape[1] - added.shape[1]
    ratio = ((before - after) / extra) / max(after / degrees, 1e-300)
    p_value = float(fdtrc(extra, degrees, ratio))
    # What so many columns explain by chance is no feedback.
    explained = max(before - after - extra * after / degrees, 0.0)
    sure = p_value < _SURE and explained > max(_SHARE * before, 0.0 if reference else _LEAST * power)
    share = explained / power
    if p_value < _DOUBT:
        # The first columns are a constant and the command's own past, the last are the news from the newest on.
        answer = weights[plain.shape[1] :].reshape(-1, experiments[0].output.shape[1])
        back = _returned(weights[1 : 1 + _LAGS], answer if reference else np.vstack([0.0 * answer[:1], answer]), noise)
        share = min(max(share, back / power), 1.0)
    return Loop(reference, share, p_value, sure)


def bears_feedback(method: Method, choices: Choices) -> bool:
    """Whether a method, chosen so, is right although the command depends on the outputs."""
    if method.loop.startswith("open"):
        return "closed_loop" in method.needs and choices.closed_loop
    # The error of a free run is not free of a command that carries it.
    return not ("focus" in method.needs and choices.focus == "simulation")


def suitable(loop: Loop) -> tuple[str, ...]:
    """Methods that bear feedback, as one would ask for them."""
    by_reference = ("iv4 --closed-loop", "indirect") if loop.reference else ()
    return ("pbsid", "pem", "bj", "armax", "arx of high order", *by_reference, "vodma --controller FILE")


def _news(data: Sequence[SampledData]) -> list[Array | None]:
    """Errors of a long ARX model of all outputs from sample `_LAGS` on; None of a stretch that is too short."""
    long = [one if len(one) > 3 * _LAGS else None for one in data]
    kept = [one for one in long if one is not None]
    if not kept:
        return [None for _ in data]
    rows = [
        np.hstack([np.ones((len(one) - _LAGS, 1)), _past(one.output, 1, _LAGS), _past(one.input, 1, _LAGS)])
        for one in kept
    ]
    targets = np.vstack([one.output[_LAGS:] for one in kept])
    errors, _ = _left(np.vstack(rows), targets)
    # Of an output that has grown beyond all noise, rounding is all that is left.
    errors[:, np.std(errors, axis=0) < _DIGITS * np.std(targets, axis=0)] = 0.0
    following = iter(np.split(errors, np.cumsum([len(part) for part in rows])[:-1]))
    return [None if one is None else next(following) for one in long]


def _past(signals: Array, least: int, first: int) -> Array:
    """Columns of all signals `least` to `_LAGS` samples ago, from the row `first` on."""
    return np.hstack([signals[first - lag : len(signals) - lag] for lag in range(least, _LAGS + 1)])


def _returned(own: Array, answer: Array, noise: Sequence[Array]) -> float:
    """Power of the command that noise makes as it goes round the loop.

    Parameters
    ----------
    own : array, shape (k,)
        Weights of the command's past, 1 to k samples ago.
    answer : array, shape (l, p)
        Weights of the outputs' news, 0 to l - 1 samples ago.
    noise : sequence of array, shape (n, p)
        The news.
    """
    from scipy.signal import lfilter

    roots = np.roots(np.r_[1.0, -own])
    # A loop that holds runs away by an error of its estimate alone.
    roots = np.where(np.abs(roots) > 1.0, 1.0 / np.conj(roots), roots) * (1.0 - _INSIDE)
    denominator = np.real(np.poly(roots))
    power = 0.0
    for news in noise:
        pairs = zip(answer.T, news.T, strict=True)
        command = np.sum([lfilter(weights, denominator, one) for weights, one in pairs], axis=0)[_LAGS:]
        power += float(command @ command)
    return power


def _left(rows: Array, target: Array) -> tuple[Array, Array]:
    """What least squares leave of a target, and their weights, by normal equations: digits enough to weigh news."""
    scale = np.linalg.norm(rows, axis=0)
    scaled = rows / np.where(scale > 0.0, scale, 1.0)
    solution = np.linalg.lstsq(scaled.T @ scaled, scaled.T @ target, rcond=_ROUNDING)[0]
    weights = (solution.T / np.where(scale > 0.0, scale, 1.0)).T
    return np.asarray(target - scaled @ solution), np.asarray(weights)
