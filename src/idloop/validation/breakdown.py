"""Distribution of the squared error along one variable, bin by bin, and its most notable part."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from idloop.arrays import Array, Integers
from idloop.validation.words import levels_text, percent, range_text

# A part is notable when its share of the error exceeds its share of the time by this much.
STANDS_OUT = 0.1


@dataclass(frozen=True)
class Part:
    """Neighbouring bins taken together."""

    # Bins; `last` is below `first` where the part includes the end of a turn
    first: int
    last: int
    # Share of the squared error, and reference share: of the time or of the signal power
    error: float
    usual: float
    # Mean (NaN for frequencies) and root mean square of the error in it
    mean: float
    rms: float
    text: str  # one sentence


@dataclass(frozen=True)
class Breakdown:
    """Distribution of the squared error along one variable."""

    # ``time``, ``frequency``, ``velocity``, ``position``, ``command``, ``direction`` or ``since_reversal``
    variable: str
    # For an axis, such as "velocity of motor" in "rad/s"
    label: str
    unit: str
    edges: Array | None  # shape (bins + 1,): increasing; None where the bins are categories
    names: tuple[str, ...]  # description of each bin
    error: Array  # shape (bins,): share of the squared error; adds up to 1
    # shape (bins,): share of the time; of the power of the measured signal along frequency. Adds up to 1.
    usual: Array
    # shape (bins,): mean and root mean square of the error in each bin, in its unit; NaN in an empty bin
    mean: Array
    rms: Array
    circular: bool = False  # the last bin is a neighbour of the first, as over a turn
    levels: Array | None = None  # shape (bins,): the values of a signal that has only a few

    @cached_property
    def worst(self) -> Part:
        """Neighbouring bins whose share of the error differs most from the reference share (Kullback-Leibler)."""
        count = len(self.error)
        order = np.concatenate([np.arange(count)] * (2 if self.circular else 1))
        longest = count if self.edges is not None else 1
        best, found = -np.inf, (0, count)
        for start in range(count):
            error = np.cumsum(self.error[order[start : start + longest]])
            usual = np.cumsum(self.usual[order[start : start + longest]])
            gain = _information(error, usual)
            stop = int(np.argmax(gain))
            # Differences of 1e-12 are rounding; of equals the narrowest part counts.
            if gain[stop] > best + 1e-12 or (gain[stop] > best - 1e-12 and stop < found[1] - found[0]):
                best, found = float(gain[stop]), (start, start + stop)
        return self._part(order[found[0] : found[1] + 1])

    @property
    def follows(self) -> float:
        """Coefficient of determination of the bin means: near 1 the error is a function of this variable.

        NaN along frequency.
        """
        if self.variable == "frequency":
            return np.nan
        known = np.isfinite(self.rms)
        weight, mean = self.usual[known], self.mean[known]
        power = float(weight @ self.rms[known] ** 2)
        if not power > 0.0:
            return 0.0
        return float(weight @ (mean - float(weight @ mean)) ** 2) / power

    @property
    def stands_out(self) -> bool:
        """Whether the share of the error in `worst` clearly exceeds its share of the time."""
        worst = self.worst
        return worst.error - worst.usual >= STANDS_OUT

    def _part(self, bins: Integers) -> Part:
        error, usual = float(np.sum(self.error[bins])), float(np.sum(self.usual[bins]))
        known = bins[np.isfinite(self.rms[bins])]
        if self.variable == "frequency":
            mean, rms = np.nan, float(np.sqrt(np.sum(self.rms[known] ** 2)))
        else:
            weight = self.usual[known] / max(float(np.sum(self.usual[known])), 1e-300)
            mean, rms = float(weight @ self.mean[known]), float(np.sqrt(weight @ self.rms[known] ** 2))
        first, last = int(bins[0]), int(bins[-1])
        return Part(first, last, error, usual, mean, rms, self._text(first, last, error, usual))

    def _text(self, first: int, last: int, error: float, usual: float) -> str:
        where = self.names[first] if first == last else self._range(first, last)
        if self.variable == "frequency":
            return f"{percent(error)} of the error is {where}, with {percent(usual)} of the measured signal's power"
        return f"{percent(error)} of the error falls in the {percent(usual)} of the time {where}"

    def _range(self, first: int, last: int) -> str:
        if self.edges is None:
            return " and ".join(self.names[first : last + 1])
        if self.levels is not None:
            return levels_text(self.variable, self.levels[first], self.levels[last], self.unit)
        if last >= len(self.edges) - 1:  # the last bin is a category
            return f"{range_text(self.variable, self.edges[first], np.inf, self.unit)} or {self.names[last]}"
        return range_text(self.variable, self.edges[first], self.edges[last + 1], self.unit)

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        edges = [] if self.edges is None else self.edges.tolist()
        share = "signal" if self.variable == "frequency" else "time"
        columns = (self.names, self.error.tolist(), self.usual.tolist(), self.mean, self.rms)
        bins = []
        for i, (name, error, usual, mean, rms) in enumerate(zip(*columns, strict=True)):
            low, high = edges[i : i + 2] if i + 1 < len(edges) else (None, None)
            bins.append({"name": name, "from": low, "to": high, "error": error, share: usual, **_sizes(mean, rms)})
        return {
            "label": self.label,
            "unit": self.unit,
            "follows": _plain(self.follows),
            "stands_out": bool(self.stands_out),
            "worst": {**vars(self.worst), **_sizes(self.worst.mean, self.worst.rms)},
            "bins": bins,
        }


def break_down(
    variable: str,
    label: str,
    unit: str,
    values: Array,
    error: Array,
    edges: Array,
    beyond: str = "",
    circular: bool = False,
    levels: Array | None = None,
) -> Breakdown:
    """Share of the squared error by ranges of a variable.

    `variable`, `label`, `unit`: see `Breakdown`.
    `values` (n,): the variable at each sample; infinite values belong to the category `beyond`.
    `error` (n,): finite.
    `edges` (bins + 1,): increasing; they enclose all finite values.
    `beyond`: description of a further bin for infinite values; empty when there are none.
    `circular`: see `Breakdown`.
    `levels` (bins,): see `Breakdown`.
    """
    index = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, len(edges) - 2)
    index = np.where(np.isfinite(values), index, len(edges) - 1)
    if levels is None:
        names = [range_text(variable, a, b, unit) for a, b in itertools.pairwise(edges)]
    else:
        names = [levels_text(variable, a, a, unit) for a in levels]
    if beyond:
        names.append(beyond)
    return Breakdown(variable, label, unit, edges, tuple(names), *sums(index, error, len(names)), circular, levels)


def sums(index: Integers, error: Array, count: int) -> tuple[Array, Array, Array, Array]:
    """Share of error and of samples, mean and rms of the error, by bin.

    `index` (n,): bin of each sample; `error` (n,): finite; `count`: number of bins. Returns `error`, `usual`, `mean`,
    `rms` (count,).
    """
    number = np.bincount(index, minlength=count).astype(float)
    # Relative to the largest error, whose square may overflow.
    size = float(np.max(np.abs(error), initial=0.0)) or 1.0
    square = np.bincount(index, (error / size) ** 2, count)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.bincount(index, error / size, count) / number * size
        rms = np.sqrt(square / number) * size
    total = float(np.sum(square))
    # An error of zero is distributed as the time is.
    share = square / total if total > 0.0 else number / len(error)
    return share, number / len(error), mean, rms


def _information(error: Array, usual: Array) -> Array:
    """Kullback-Leibler divergence of two shares; negative where the error share is below the reference share."""
    e, u = np.clip(error, 0.0, 1.0), np.clip(usual, 1e-12, 1.0 - 1e-12)

    def term(a: Array, b: Array) -> Array:
        return np.where(a > 0.0, a * np.log(np.maximum(a, 1e-300) / b), 0.0)

    return np.asarray(np.sign(e - u) * (term(e, u) + term(1.0 - e, 1.0 - u)))


def _sizes(mean: float, rms: float) -> dict[str, float | None]:
    return {"mean": _plain(mean), "rms": _plain(rms)}


def _plain(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
