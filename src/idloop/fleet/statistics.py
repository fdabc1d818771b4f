"""What belongs to the kind, the unit and the day; units that are odd, changes, and days that are, at one rate.

The estimate of a parameter is  kind + date + unit + day + error:  a mean of the kind, an effect of the date that all
units of the kind share, a unit's own deviation, a deviation of the single recording, and the error that the fit
states. Effects of dates are medians (median polish, Tukey, Exploratory Data Analysis, 1977). Units and days are random
effects under known errors (Paule and Mandel, J. Res. NBS 87, 1982, by statsmodels), estimated without what is too far
off for a normal distribution, so that odd units do not hide themselves. A unit's own value is shrunk towards its kind
by its share of the variance, and by one standard error at most: an odd unit is not of the distribution (Efron and
Morris, J. American Statistical Association 67, 1972).

Tested are each unit (is it odd among its kind?), each unit over time (a trend or a step, against its kind), each kind
over time, and each recording (does it leave the course of its unit, by the tails that recordings have?). All p-values
together are held to one rate of false discoveries (Benjamini and Hochberg, J. Royal Statistical Society B 57, 1995, by
SciPy).
"""

from __future__ import annotations

import warnings
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np
from scipy.special import stdtr, stdtrit
from scipy.stats import false_discovery_control, median_abs_deviation, t

from idloop.arrays import Array, Mask
from idloop.fleet.joint_day import FORCE_ERROR
from idloop.fleet.libraries import library

LEVEL = 0.05
RELATIVE = "relative"  # in the place of a unit: a share of what is differed from
FEWEST_UNITS = 5  # that share the effect of a date, or among which one can be odd
FEWEST_DAYS = 4  # recordings of a trend or a step
_SIDE = 2  # recordings on either side of a step
_LEAST_VARIANCE = 1e-6  # of an error, in squares of the scale
_TOLERANCE = 1e-6  # of the equation of Paule and Mandel, which is a sum, for each of its terms
_ROUNDS = 10
_EFFICIENCY = 0.37  # of the median of absolute deviations: degrees of freedom of a variance from it
_POLISHES = 4
_CONVERGED = 0.03  # standard deviations of a recording
_OF_LARGEST = 0.5  # change of a unit, beside the largest one, that no effect of dates can have made
_OF_CHANGE = 3  # parameters of a change: level, size and place
_FEWEST_OF_MEMORY = 12  # recordings: fewer have no memory that differs from none
_MOST_MEMORY = 0.9
_FAR = 0.7  # of the degrees of freedom that fit the middle of the tails: counted, their ends are heavier
_CLIP = 2.5  # standard deviations from a unit's median beyond which a recording adds no evidence of a change
_NORMAL = 1.4826  # standard deviations of a normal distribution in a median of absolute deviations
_FEWEST_TAILS, _MOST_TAILS = 200, 20_000  # recordings from which tails are estimated


@dataclass(frozen=True)
class Series:
    """One parameter of one kind in every recording, units in rows and dates in columns."""

    # The last is the physical unit; `natural` gives values in it
    kind: str
    parameter: str
    unit: str
    names: tuple[tuple[str, str], ...]  # robot and joint of each row
    days: Array  # shape (d,): dates [days since 1970]
    # shape (units, d): estimates, of the force error as logarithms, and the squares of their standard errors; NaN where
    # there is none
    value: Array
    variance: Array
    least: float = -np.inf  # bound of the parameter from below

    def natural(self, value: Array | float) -> Array:
        """Value in the unit of the parameter."""
        return np.exp(value) if self.parameter == FORCE_ERROR else np.asarray(value)

    def natural_interval(self, value: Array, stderr: Array, freedom: float) -> tuple[Array, Array]:
        """Ends of 95 % intervals in the unit of the parameter."""
        reach = stderr * _reach(1.0, freedom)
        return self.natural(value - reach), self.natural(value + reach)

    def slope(self, value: Array | float) -> Array:
        """What a small change of a value is in the unit of the parameter."""
        return self.natural(value) if self.parameter == FORCE_ERROR else np.ones(np.shape(value))


@dataclass(frozen=True)
class Components:
    """A series taken apart."""

    series: Series
    # Of the kind
    mean: float
    mean_stderr: float
    # shape (d,): effect of each date; 0 where fewer than five units share it: then it adds to the variance, as others
    # do
    date: Array
    date_stderr: Array
    # shape (units,): mean of each unit without the dates, its standard error, and its best prediction
    level: Array
    level_stderr: Array
    shrunk: Array
    # Standard deviations of units and of days, beyond the errors
    unit_deviation: float
    day_deviation: float
    memory: float  # correlation of a unit's successive recordings
    left: Array  # shape (units, d): estimates without the effects of dates
    total: Array  # shape (units, d): variances of single recordings: error and day
    # Degrees of freedom of the variances of days and of units
    freedom: float
    unit_freedom: float
    # shape (units,): units of the distribution that mean and deviation describe; the others are too far off to be of it
    kept: Mask


@dataclass(frozen=True)
class Finding:
    """One test."""

    what: str  # ``odd`` unit, ``trend``, ``step``, or ``day``
    kind: str
    parameter: str
    unit: str
    # Empty for a kind
    robot: str
    joint: str
    # First recording of a step, on which an odd unit is outside of 95 % of its kind, or that an alarm counts; the one
    # of a day; the last one of a trend [days since 1970]
    day: float
    # Deviation of a unit from the mean of its kind, change of a trend from the first to the last recording, change at a
    # step, deviation of a day from the course of its unit, growth of an alarm over its reference, with its 95 %
    # interval; of the force error relative to what it differs from
    size: float
    low: float
    high: float
    # The second is the rate of false discoveries at which it is found
    p_value: float
    q_value: float = 1.0


def series_of(
    kind: str, parameter: str, unit: str, joints: Sequence[tuple[str, str]], days: Array, value: Array, stderr: Array,
    least: float = -np.inf,
) -> Series:  # fmt: skip
    """Arrange the estimates of a parameter by joint and date.

    `joints`: robot and joint of each estimate. `days` (n,): in the order of time: of several recordings of a date the
    last one counts. `value`, `stderr` (n,): NaN where not known. An error of the force is taken as its logarithm.
    `least`: bound of the parameter from below.
    """
    names = sorted(set(joints))
    place = {name: number for number, name in enumerate(names)}
    dates, column = np.unique(np.floor(days), return_inverse=True)
    if parameter == FORCE_ERROR:
        value, stderr = np.log(np.maximum(value, 1e-12)), np.zeros(len(value))
    known = np.isfinite(value) & np.isfinite(stderr)
    row = np.array([place[name] for name in joints])[known]
    table = np.full((2, len(names), len(dates)), np.nan)
    table[:, row, column[known]] = value[known], stderr[known] ** 2
    return Series(kind, parameter, unit, tuple(names), dates, table[0], table[1], least)


class RandomEffect(NamedTuple):
    """Mean of estimates, its standard error, and the variance beyond their errors with its degrees of freedom.

    `kept`: which estimates they describe, shape (n,).
    """

    mean: float
    stderr: float
    variance: float
    freedom: float
    kept: Mask


def random_effect(value: Array, variance: Array) -> RandomEffect:
    """Combine estimates whose errors are known, without those that are too far off to be of one normal distribution."""
    known = np.isfinite(value) & np.isfinite(variance)
    y, own = value[known], variance[known]
    if not len(y):
        return RandomEffect(np.nan, np.nan, 0.0, 1.0, known)
    median = float(np.median(y))
    scale = float(median_abs_deviation(y, scale="normal")) or float(np.std(y))
    if not scale:
        return RandomEffect(median, float(np.sqrt(np.mean(own) / len(y))), 0.0, max(len(y) - 1.0, 1.0), known)
    combine = library("statsmodels.stats.meta_analysis").combine_effects
    # In units of the scale: what is tolerated is a number, and no estimate is exact.
    y, own = (y - median) / scale, np.maximum(own / scale**2, _LEAST_VARIANCE)
    kept = np.zeros(len(y), dtype=bool)
    found = RandomEffect(0.0, 0.0, 1.0, _EFFICIENCY * len(y), ~kept)
    for _ in range(_ROUNDS):
        reach = -float(stdtrit(found.freedom, 0.5 * LEVEL / len(y)))
        before, kept = kept, np.abs(y - found.mean) <= reach * np.sqrt(own + found.variance)
        if kept.sum() < 2 or (kept == before).all():
            break
        effect = combine(y[kept], own[kept], "iterated", atol=_TOLERANCE * kept.sum())
        found = RandomEffect(effect.mean_effect_re, effect.sd_eff_w_re, effect.tau2, kept.sum() - 1.0, kept)
    mean, stderr, beyond, freedom = map(float, found[:4])
    known[known] = found.kept
    return RandomEffect(median + scale * mean, scale * stderr, scale**2 * beyond, freedom, known)


def wander(steps: Array, errors: Array) -> tuple[float, float]:
    """Variance of single values beyond their errors, and its degrees of freedom.

    From successive differences and the variances of their errors. Two differences share each value: independent ones
    would have half as many degrees of freedom more.
    """
    found = random_effect(steps, errors)
    return 0.5 * found.variance, max(2.0 / 3.0 * found.freedom, 1.0)


def take_apart(series: Series) -> Components:
    """Tell kind, date, unit and day apart."""
    y, own = series.value, series.variance
    shared = np.sum(np.isfinite(y), axis=0) >= FEWEST_UNITS
    changes, steady = np.zeros(y.shape), np.ones(len(y), dtype=bool)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # the median of nothing is NaN
        for _ in range(_ROUNDS):
            date, of_unit = _effects_of_dates(y - changes, shared)
            left = y - of_unit
            # What a date does that too few share cannot be told: it may be what other dates do.
            single = own + np.where(shared, 0.0, np.var(date[shared])) if shared.any() else own
            day, freedom = wander(*_successive(left, single))
            rho, found, size = _own_changes(series.days, left, single + day, freedom)
            # The largest first: what several units do at once moves the others the other way.
            steady &= size <= _OF_LARGEST * np.max(size[steady], initial=0.0)
            before, changes = changes, np.where(steady[:, None], 0.0, found)
            if np.max(np.abs(changes - before)) <= _CONVERGED * np.sqrt(np.nanmedian(single + day)):
                break
        total = (single + day) * _inflation(rho)
        level, error = _means(left, total)
        count = np.maximum(np.sum(np.isfinite(left), axis=0), 1)
        date_stderr = np.sqrt(np.nanmedian(total, axis=0) * (np.pi / 2.0) / count)
    mean, mean_stderr, between, unit_freedom, kept = random_effect(level, error)
    towards = (mean - level) * error / np.maximum(between + error, 1e-300)
    shrunk = level + np.clip(towards, -np.sqrt(error), np.sqrt(error))
    return Components(
        series, mean, mean_stderr, date, date_stderr, level, np.sqrt(error), shrunk, float(np.sqrt(between)),
        float(np.sqrt(day)), rho, left, total, freedom, unit_freedom, kept,
    )  # fmt: skip


def _means(value: Array, variance: Array) -> tuple[Array, Array]:
    """Weighted mean of each row and its variance; NaN without a value."""
    weight = np.where(np.isfinite(value), 1.0 / np.maximum(variance, 1e-300), 0.0)
    total = np.where(weight.any(axis=1), np.sum(weight, axis=1), np.nan)
    return np.sum(weight * np.nan_to_num(value), axis=1) / total, 1.0 / total


def _clipped_means(value: Array, variance: Array) -> tuple[Array, Array]:
    """As `_means`, of values that are no further from the median of their row than single recordings are."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        middle, reach = np.nanmedian(value, axis=1)[:, None], _CLIP * np.sqrt(variance)
    return _means(np.clip(value, middle - reach, middle + reach), variance)


def _successive(left: Array, own: Array) -> tuple[Array, Array]:
    """Differences of each unit's successive recordings, and the variances of their errors."""
    known = [np.isfinite(row) for row in left]
    steps = [np.diff(row[seen]) for row, seen in zip(left, known, strict=True)]
    errors = [row[seen][1:] + row[seen][:-1] for row, seen in zip(own, known, strict=True)]
    return np.concatenate([np.zeros(0), *steps]), np.concatenate([np.zeros(0), *errors])


def _effects_of_dates(y: Array, shared: Mask) -> tuple[Array, Array]:
    """Median polish of units and dates: effects of the dates (d,), 0 where too few units share one, and on each unit.

    What a date does may grow with the level of a unit, as a gain does: a term for their product (Tukey, Biometrics 5,
    1949).
    """
    date = np.zeros(y.shape[1])
    for _ in range(_POLISHES if shared.any() else 0):
        level = np.nanmedian(y - date, axis=1)
        date = np.where(shared, np.nanmedian(y - level[:, None], axis=0), 0.0)
        date = date - np.median(date[shared])
    if not date.any():
        return date, np.zeros(y.shape)
    rest = y - level[:, None] - date
    away = level - np.nanmedian(level)
    product = away[:, None] * date
    # Without what is far off: one unit or recording shall not tell what a date does to the others.
    usual = np.isfinite(rest) & _near(rest) & _near(away)[:, None]
    x, z = product[usual], rest[usual]
    found = x @ z
    # Where it is told from none: what is far off would have the error of it many times.
    told = found**2 > _CLIP**2 * (x @ x) * np.mean(z**2) if len(z) else False
    share = found / (x @ x) if told else 0.0
    return date, date + share * product


def _near(away: Array) -> Mask:
    """Which deviations are no further off than most are."""
    return np.asarray(np.abs(away) <= _CLIP * _NORMAL * np.nanmedian(np.abs(away)))


def _own_changes(days: Array, left: Array, variance: Array, freedom: float) -> tuple[float, Array, Array]:
    """Correlation of a unit's successive recordings, the change of each unit, and its size over its standard error.

    The first is the median of those about each unit's own course: the mean of the unit, or its change where it has
    one: of few units, the change of one would count as the memory of all, and would hide itself.
    """
    known = np.isfinite(left)
    places = np.flatnonzero(known.sum(axis=1) >= FEWEST_DAYS)
    several = {k: (days[known[k]], left[k, known[k]], variance[k, known[k]]) for k in places}
    long = [k for k, (_, y, _) in several.items() if len(y) >= 2 * FEWEST_DAYS]
    remembered = sum(len(several[k][1]) for k in long) >= _FEWEST_OF_MEMORY
    changed = {
        k: _correlation(y - best_change(at, y, error, freedom).course, _OF_CHANGE)
        for k, (at, y, error) in several.items()
        if k in long and remembered
    }
    wider = _inflation(_median_memory(list(changed.values())))
    course, size, memory = np.zeros(left.shape), np.zeros(len(left)), []
    for k, (at, y, error) in several.items():
        change = best_change(at, y, wider * error, freedom)
        own = change.p_value < LEVEL / len(several)
        if own:
            course[k, known[k]] = change.course - np.median(change.course)
            size[k] = abs(change.size) / change.stderr
        if k in changed:
            memory.append(changed[k] if own else _correlation(y - np.mean(y), 1))
    return _median_memory(memory), course, size


def _correlation(away: Array, parameters: int) -> float:
    """Correlation of successive deviations from a course with so many fitted parameters.

    It is too small by (p + 2 (p + 1) rho) / n: known of a mean (Kendall, Biometrika 41, 1954), counted for three
    parameters. Solved for rho, where it divides by n / 2 at least: few recordings would multiply their noise.
    """
    power, count = float(away @ away), len(away)
    found = float(away[1:] @ away[:-1]) / power if power > 0.0 else 0.0
    slope = 2.0 * (parameters + 1.0)
    return found + (parameters + slope * found) / max(count - slope, 0.5 * count)


def _median_memory(several: Sequence[float] | Array) -> float:
    return float(np.clip(np.median(several), 0.0, _MOST_MEMORY)) if len(several) else 0.0


def _inflation(memory: float) -> float:
    """Variance of a mean of many recordings over that which their successive differences have."""
    return (1.0 + memory) / (1.0 - memory) ** 2


class Hypotheses:
    """Tests that share one rate of false discoveries, of which every question has the same part.

    The parts are weights of p-values (Genovese, Roeder and Wasserman, Biometrika 93, 2006): single recordings are so
    many that without them few odd units would be found.

    `level`: the rate. `count`: of the tests.
    """

    def __init__(self, level: float = LEVEL) -> None:
        self.level = level
        self.count = 0
        self._p_values: list[tuple[str, Array]] = []
        self._candidates: dict[int, Finding] = {}

    def add(self, p_values: Array, finding: Callable[[int], Finding], question: str = "") -> None:
        """Add tests (n,) of a question; the finding of one is only made where the rate may leave it."""
        for place in np.flatnonzero(p_values <= self.level).tolist():
            self._candidates[self.count + place] = finding(place)
        self._p_values.append((question, p_values))
        self.count += len(p_values)

    def found(self) -> list[Finding]:
        """Findings that the rate leaves, by their p-values."""
        if not self.count:
            return []
        asked: Counter[str] = Counter()
        for question, several in self._p_values:
            asked[question] += len(several)
        weighted = [several * (len(asked) * asked[question] / self.count) for question, several in self._p_values]
        rates = false_discovery_control(np.minimum(np.concatenate(weighted), 1.0))
        left = (replace(one, q_value=float(rates[place])) for place, one in self._candidates.items())
        kept = [one for one in left if one.q_value <= self.level]
        return sorted(kept, key=lambda one: (one.p_value, -abs(one.size), one.robot, one.joint))

    def test(self, parts: Components) -> None:
        """Add every test of a parameter of a kind."""
        series = parts.series
        among = np.hypot(parts.unit_deviation, parts.level_stderr)
        single: list[tuple[tuple[str, str], Array, Array, Array]] = []
        for place, name in enumerate(series.names):
            seen = np.isfinite(parts.left[place])
            if not seen.any():
                continue
            days, y, variance = series.days[seen], parts.left[place][seen], parts.total[place][seen]
            course = np.full(len(y), parts.level[place])
            if len(y) >= FEWEST_DAYS:
                change = best_change(days, y, variance, parts.freedom)
                self._one("change", change.p_value, partial(_change, series, change, name))
                course = change.course if change.p_value < LEVEL else course
            if len(series.names) >= FEWEST_UNITS:
                size = float(parts.level[place] - parts.mean)
                stderr = float(np.hypot(parts.level_stderr[place], parts.mean_stderr))
                freedom = min(parts.freedom, parts.unit_freedom)
                outside = np.abs(course - parts.mean) > _reach(among[place], parts.unit_freedom)
                since = float(days[np.argmax(outside)])
                odd = partial(finding_of, series, "odd", since, size, stderr, freedom, name)
                self._one("odd", float(_p(size, among[place], parts.unit_freedom)), odd)
            if len(y) >= FEWEST_DAYS - 1:
                # A recording is a part of its own unit's mean.
                error = np.sqrt(variance * (1.0 - (1.0 / variance) / np.sum(1.0 / variance)))
                single.append((name, days, y - course, error))
        tails, scale = _tails([away / error for _, _, away, error in single], parts.freedom)
        for name, days, away, error in single:
            p_values = _p(away, scale * error, tails)
            self.add(p_values, partial(_day, series, days, away, scale * error, tails, p_values, name), "day")
        kind = _dates(parts)
        if kind is not None:
            self._one("change", kind.p_value, partial(_change, series, kind, ("", "")))

    def _one(self, question: str, p_value: float, finding: Callable[[float], Finding]) -> None:
        self.add(np.array([p_value]), lambda place: finding(p_value), question)


def finding_of(
    series: Series, what: str, day: float, size: float, stderr: float, freedom: float, name: tuple[str, str],
    p_value: float,
) -> Finding:  # fmt: skip
    """Finding with its size and interval, by Student's t as its p-value; those of a logarithm are relative."""
    reach = _reach(stderr, freedom)
    ends = np.array([size, size - reach, size + reach])
    relative = series.parameter == FORCE_ERROR
    size, low, high = (np.expm1(ends) if relative else ends).tolist()
    unit = RELATIVE if relative else series.unit
    return Finding(what, series.kind, series.parameter, unit, *name, day, size, low, high, p_value)


def _reach(stderr: float, freedom: float) -> float:
    """Half of a 95 % interval, by Student's t."""
    return float(stdtrit(freedom, 0.975)) * stderr


def _change(series: Series, change: Change, name: tuple[str, str], p_value: float) -> Finding:
    return finding_of(series, change.what, change.day, change.size, change.stderr, change.freedom, name, p_value)


def _day(
    series: Series, days: Array, away: Array, error: Array, freedom: float, p: Array, name: tuple[str, str], place: int
) -> Finding:
    at, size, stderr, p_value = (float(one[place]) for one in (days, away, error, p))
    return finding_of(series, "day", at, size, stderr, freedom, name, p_value)


def _shared(parts: Components) -> Mask:
    """Dates of which the effect is known."""
    return np.asarray(np.sum(np.isfinite(parts.left), axis=0) >= FEWEST_UNITS)


def _scatter_of_dates(parts: Components) -> tuple[float, float]:
    """Variance of the effects of dates beyond their errors, and its degrees of freedom."""
    shared = _shared(parts)
    own = parts.date_stderr[shared] ** 2
    return wander(np.diff(parts.date[shared]), own[1:] + own[:-1])


def _dates(parts: Components) -> Change | None:
    """Change of a kind: of what its units share."""
    shared = _shared(parts)
    if shared.sum() < FEWEST_DAYS:
        return None
    more, freedom = _scatter_of_dates(parts)
    y, own = parts.date[shared], parts.date_stderr[shared] ** 2
    return best_change(parts.series.days[shared], y, own + more, freedom, np.inf)


@dataclass(frozen=True)
class Change:
    """The likelier of a trend and a step: its size over all days, and the course that it describes, shape (n,).

    `freedom`: degrees of freedom of the variance, and so of the standard error.
    """

    what: str
    day: float
    size: float
    stderr: float
    freedom: float
    p_value: float
    course: Array


def best_change(days: Array, y: Array, variance: Array, freedom: float, clip: float = _CLIP) -> Change:
    """Test a trend and a step at every day; the level is divided by their number (Bonferroni).

    `days`, `y`, `variance` (n,): in the order of time. `freedom`: degrees of freedom of the variance. `clip`: standard
    deviations from the median beyond which a value adds no evidence.
    """
    weight = 1.0 / np.maximum(variance, 1e-300)
    shapes = [("trend", float(days[-1]), (days - days[0]) / (days[-1] - days[0]))]
    splits = range(_SIDE, len(days) - _SIDE + 1)
    shapes += [("step", float(days[first]), (np.arange(len(days)) >= first).astype(float)) for first in splits]
    middle, reach = np.median(y), clip * np.sqrt(variance)
    x = np.array([shape for _, _, shape in shapes])
    x = x - (x @ weight / np.sum(weight))[:, None]
    information = (x**2) @ weight
    size = (x @ (weight * y)) / information
    # Evidence is that of clipped values: a few recordings far off are no change of all that follow.
    clipped = np.abs(x @ (weight * np.clip(y, middle - reach, middle + reach))) / np.sqrt(information)
    steps = max(len(shapes) - 1, 1)
    # Half of the level for the trend, half for the steps together.
    p = _p(np.array([clipped[0], np.max(clipped[1:], initial=0.0)]), 1.0, freedom) * [2.0, 2.0 * steps]
    place = int(np.argmax(np.abs(size) * np.sqrt(information)))  # the likelier one
    what, day, _ = shapes[place]
    course = np.sum(weight * y) / np.sum(weight) + size[place] * x[place]
    stderr = float(1.0 / np.sqrt(information[place]))
    return Change(what, day, float(size[place]), stderr, freedom, float(min(np.min(p), 1.0)), course)


def _tails(several: Sequence[Array], freedom: float) -> tuple[float, float]:
    """Degrees of freedom and scale of Student's t that standardised recordings have, by maximum likelihood.

    A fit errs in its own way where a motion shows little of a parameter: single recordings have heavier tails than
    means of many.
    """
    z = np.concatenate(several) if several else np.zeros(0)
    if len(z) < _FEWEST_TAILS:
        return freedom, 1.0
    found, _, scale = t.fit(z[:: len(z) // _MOST_TAILS + 1], floc=0.0)
    return min(_FAR * float(found), freedom), float(scale)


def _p(away: Array | float, error: Array | float, freedom: float) -> Array:
    """Two-sided p-values of Student's t."""
    return np.asarray(2.0 * stdtr(freedom, -np.abs(away) / np.maximum(error, 1e-300)))


def between_periods(parts: Components, since: float, against: float | None) -> tuple[list[Finding], list[Finding]]:
    """Change of a kind and of its units from the days of ``[against, since)`` to those from ``since`` on.

    Each unit is compared with itself. The change of the kind is the mean of its units' changes under a random effect,
    with the scatter of the dates that they share; it takes two units. Of five units and more the change of each is that
    beyond this mean, among the changes of the others.

    `since`, `against`: first day of the later and of the earlier period [days since 1970]; None: everything before.
    Returns `kind`, `units`: their tests, whatever their p-values; none of a kind of which one unit alone has both
    periods.
    """
    series, begin = parts.series, -np.inf if against is None else against
    periods = (series.days < since) & (series.days >= begin), series.days >= since
    (before, old), (after, new) = (_clipped_means(np.where(one, series.value, np.nan), parts.total) for one in periods)
    known = np.isfinite(after - before) & (old + new > 1e-200)
    if not known.any():
        return [], []
    size, variance = (after - before)[known], (old + new)[known]
    names = [name for name, one in zip(series.names, known, strict=True) if one]
    mean, stderr, effect, joints, _ = random_effect(size, variance)
    freedom = min(parts.freedom, joints) if effect > 0.0 else parts.freedom
    dates, of_dates = _scatter_of_dates(parts)
    count = [max(int(np.sum(_shared(parts) & one)), 1) for one in periods]
    whole = float(np.sqrt(stderr**2 + dates * sum(1.0 / one for one in count)))
    few = min(freedom, of_dates) if dates > 0.0 else freedom
    kind = [finding_of(series, "period", since, mean, whole, few, ("", ""), float(_p(mean, whole, few)))]
    # Where enough joints share the change of their kind, one is of interest that does otherwise.
    enough = len(size) >= FEWEST_UNITS
    what, away = ("beyond", size - mean) if enough else ("period", size)
    among = np.sqrt(variance + effect * enough)
    p_values = _p(away, among, freedom if enough else parts.freedom)
    units = [
        finding_of(series, what, since, one, error, parts.freedom, name, p)
        for name, one, error, p in zip(names, away.tolist(), np.sqrt(variance).tolist(), p_values.tolist(), strict=True)
    ]
    return kind if len(size) > 1 else [], units
