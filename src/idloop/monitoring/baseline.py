"""What is normal: a fitted model on records of the healthy machine, and the thresholds that follow from them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from idloop.errors import IdloopError, InputError
from idloop.estimation.dataset import prepare
from idloop.estimation.optimisation.smooth_engine import RememberingEngine
from idloop.estimation.statistics.covariance import long_run_covariance
from idloop.monitoring.block_scores import Evident, Scores, block_scores, evident, join
from idloop.monitoring.false_alarms import USUAL_HOURS
from idloop.monitoring.reference_observer import Lens, grind
from idloop.monitoring.run_length import Evidence, detection_delay, find_threshold, needed_reference
from idloop.monitoring.watch import Watch, may_vary

if TYPE_CHECKING:
    from idloop.physics import Model
    from idloop.records import Record

Array = NDArray[np.float64]
Progress = Callable[[float, str], None]

BLOCK = 2.0  # [s]
# Fewer telling blocks than this show neither offset nor variance.
FEWEST = 20
# A block that tells less than this share of the reference's mean information tells nothing.
LEAST_SHARE = 0.02
# Where less of a change shows than this, what shows is as likely something else.
_FAINTEST = 0.1
# A record is worked off in stretches of this length [s].
_STRETCH = 120.0
# Changes of a parameter that may vary: slopes are taken over so much of its value.
_STEP = 0.1


@dataclass(frozen=True)
class Normal:
    """What the healthy reference shows of one watch.

    Attributes
    ----------
    watch : Watch
    offset, offset_stderr : float
        Change that the scores of the reference itself show, against the model [unit].
    echo : float
        Part of a change that the scores show: 1 for an observer that knows the state, less where noise in what it
        knows makes the slopes larger than they are.
    spread : float
        Long-run variance of the scores against what white innovations would give.
    information : float
        Mean information of a telling block [1/unit²].
    evidence : Evidence or None
        None where the reference tells too little.
    threshold : float
        Of the CUSUM; infinite where it cannot alarm.
    why : str
        Why it cannot; empty where it can.
    """

    watch: Watch
    offset: float
    offset_stderr: float
    spread: float
    information: float
    evidence: Evidence | None
    threshold: float
    why: str = ""
    echo: float = 1.0

    def ratio(self, score: Evident) -> Array:
        """Log-likelihood ratio of the watched growth against none, for each block (b,)."""
        growth = self.echo * self.watch.growth
        centred = score.gradient - score.information * self.offset
        return np.asarray((growth * centred - 0.5 * growth**2 * score.information) / self.spread)


@dataclass(frozen=True)
class Baseline:
    """Everything that a monitor knows before it begins.

    Attributes
    ----------
    model : Model
        With exactly the parameters free that are watched or may vary.
    watches : tuple of Watch
    varying : tuple of str
        Parameters that may change without being wear.
    false_alarm_hours : float
        Running time between two false alarms of all watches together [h].
    block : float
        Length of a block [s].
    lens : Lens
    normal : tuple of Normal
        One for each watch.
    duration : float
        Of the reference [s].
    """

    model: Model
    watches: tuple[Watch, ...]
    varying: tuple[str, ...]
    false_alarm_hours: float
    block: float
    lens: Lens
    normal: tuple[Normal, ...]
    duration: float

    @cached_property
    def engine(self) -> RememberingEngine:
        """The model, compiled."""
        return RememberingEngine(self.model)

    def __getstate__(self) -> dict[str, object]:
        """Travel without the compiled model."""
        return {name: value for name, value in self.__dict__.items() if name != "engine"}

    def scores(self, record: Record) -> Scores:
        """Scores of the whole blocks of a record, on the grid of its absolute clock.

        Raises
        ------
        InputError
            The record does not suit the model, or was sampled at another rate than the reference.
        """
        return join([self._stretch(part) for part in self._stretches(record)])

    def _stretches(self, record: Record) -> Iterator[Record]:
        """A long record in parts that overlap by what the observer takes to settle: memory stays bounded."""
        start, end = float(record.time[0]), float(record.time[-1])
        warm = self.settling + self.block
        while True:
            stop = start + max(_STRETCH, 4.0 * warm)
            # No short rest: it could be too short to be read.
            last = stop + warm >= end
            yield record.cut(start, end if last else stop)
            if last:
                return
            start = stop - warm

    def _stretch(self, record: Record) -> Scores:
        (data,) = prepare(self.model, [record], every=True)
        if abs(data.sample_time - self.lens.sample_time) > 0.05 * self.lens.sample_time:
            raise InputError(
                f"record {record.name!r} is sampled every {data.sample_time:.4g} s, the reference every "
                f"{self.lens.sample_time:.4g} s: an observer serves one rate"
            )
        steps = step_sizes(self.model, self.watches)
        # The grid is that of the absolute clock: a record cut in two has the same blocks.
        first, past = divmod(record.start_ns, round(self.block * 1e9))
        found = block_scores(self.engine, self.lens, self.model.theta, steps, data, self.block, -past * 1e-9)
        return replace(found, index=found.index + first)

    @property
    def settling(self) -> float:
        """Time that the observer takes to forget its start [s]."""
        longest = max(whitener.order for whitener in self.lens.whiteners)
        return float((self.lens.memory + longest) * self.lens.sample_time)

    def end_of(self, block: int) -> int:
        """Absolute stamp of the end of a block [ns]."""
        return (block + 1) * round(self.block * 1e9)

    def evident(self, scores: Scores) -> list[Evident]:
        """What the scores say about each watch, whatever the other parameters do."""
        steps = step_sizes(self.model, self.watches)
        return [evident(scores, self.model.free.index(w.parameter), np.abs(steps)) for w in self.watches]

    def promising(self, false_alarm_hours: float) -> Baseline:
        """The same reference with the thresholds of another rate of false alarms.

        Parameters
        ----------
        false_alarm_hours : float
            Running time between two false alarms of all watches together [h].

        Raises
        ------
        InputError
            It is not positive.
        """
        if not 0.0 < false_alarm_hours < np.inf:
            raise InputError("the time between two false alarms must be positive")
        hours = false_alarm_hours * len(self.watches)
        normal = tuple(_with_threshold(one, hours, self.block) for one in self.normal)
        return replace(self, false_alarm_hours=false_alarm_hours, normal=normal)

    def delay(self, which: int, evidence: Evidence | None = None, growth: float = 1.0) -> float:
        """Expected time from a sudden growth to its alarm [s].

        Parameters
        ----------
        which : int
            Watch.
        evidence : Evidence, optional
            Of the data in which it is to be noticed; the reference by default.
        growth : float
            In units of the watched growth.
        """
        normal, known = self.normal[which], evidence or self.normal[which].evidence
        if known is None or not np.isfinite(normal.threshold):
            return float("inf")
        return self.block * detection_delay(normal.threshold, known, growth)


def step_sizes(model: Model, watches: Sequence[Watch]) -> Array:
    """Changes over which the slopes of the free parameters are taken, shape (k,)."""
    growths = {watch.parameter: watch.growth for watch in watches}
    steps = []
    for name, value, high in zip(model.free, model.theta, model.bounds[1], strict=True):
        step = growths.get(name, _STEP * abs(value) or 1e-6)
        steps.append(step if name in growths or value + step <= high else -step)
    return np.array(steps)


def learn(
    model: Model,
    records: Sequence[Record],
    watches: Sequence[Watch],
    *,
    varying: Sequence[str] = (),
    false_alarm_hours: float = USUAL_HOURS,
    block: float = BLOCK,
    progress: Progress | None = None,
) -> Baseline:
    """Learn from records of the healthy machine what is normal.

    Parameters
    ----------
    model : Model
        Fitted to the machine; its values are those against which growth counts.
    records : sequence of Record
        The machine as it is when healthy, in the motions in which it will be watched.
    watches : sequence of Watch
        At least one.
    varying : sequence of str
        Parameters that may change without being wear, beside viscous friction.
    false_alarm_hours : float
        Running time between two false alarms of all watches together [h].
    block : float
        Length of a block [s].
    progress : callable, optional
        Called with the share done in [0, 1] and a short text.

    Returns
    -------
    Baseline

    Raises
    ------
    InputError
        The records do not suit the model, or each is shorter than a block.
    IdloopError
        No observer can be designed.
    """
    if not 0.0 < block < np.inf:
        raise InputError("the length of a block must be positive")
    tell = progress or (lambda share, text: None)
    others = may_vary(model, watches, varying)
    free = model.with_free([*(watch.parameter for watch in watches), *others])
    data = prepare(free, records, every=True)
    tell(0.0, "the observer")
    lens = grind(RememberingEngine(free), data, free.theta)
    bare = Baseline(free, tuple(watches), others, false_alarm_hours, block, lens, (), sum(r.duration for r in records))
    found = []
    for number, record in enumerate(records):
        tell(0.5 + 0.5 * number / len(records), "the reference")
        found.append(bare.evident(bare.scores(record)))
    if not any(len(one[0].gradient) for one in found):
        raise InputError(
            f"the reference holds no whole block of {block:g} s after the {bare.settling:.2g} s that the observer "
            "takes to settle: record for longer"
        )
    normal = tuple(
        _normal(watch, [one[i] for one in found], [one[i] for one in _moved(bare, watch, records)], _away(free, watch))
        for i, watch in enumerate(watches)
    )
    return replace(bare, normal=normal).promising(false_alarm_hours)


def _away(model: Model, watch: Watch) -> float:
    """Change of the model that makes the healthy machine look worn: backwards by the growth, or forwards at a bound."""
    known = model.parameter(watch.parameter)
    return -watch.growth if known.min <= known.value - watch.growth <= known.max else watch.growth


def _moved(bare: Baseline, watch: Watch, records: Sequence[Record]) -> list[list[Evident]]:
    """What the healthy records say about each watch when the model is the one that is off."""
    model = bare.model.with_values({watch.parameter: watch.value + _away(bare.model, watch)})
    other = replace(bare, model=model)
    return [other.evident(other.scores(record)) for record in records]


def _mean_change(records: list[Evident]) -> float:
    """Change that all blocks together show, in the scores' own measure [unit]."""
    total = sum(float(np.sum(one.information)) for one in records)
    return sum(float(np.sum(one.gradient)) for one in records) / max(total, 1e-300)


def _normal(watch: Watch, records: list[Evident], moved: list[Evident], away: float) -> Normal:
    """Offset, echo and long-run variance of one watch from the reference's blocks, without a threshold.

    Parameters
    ----------
    watch : Watch
    records, moved : list of Evident
        Of the reference, with the model and with the model changed.
    away : float
        By how much it was changed [unit].
    """
    information = np.concatenate([one.information for one in records])
    mean = float(np.mean(information))
    telling = information > LEAST_SHARE * mean
    nothing = f"the reference tells nothing about {watch.parameter}: its motion does not show it"
    if not mean * watch.growth**2 > 1e-9 or np.sum(telling) < 2:
        return Normal(watch, 0.0, np.inf, 1.0, 0.0, None, np.inf, nothing)
    total = float(np.sum(information))
    offset = _mean_change(records)
    series = []
    for one in records:
        keep = one.information > LEAST_SHARE * mean
        z = (one.gradient[keep] - one.information[keep] * offset) / np.sqrt(one.information[keep])
        if len(z) > 2:
            series.append(z[:, None])
    if sum(len(z) for z in series) < FEWEST:
        why = f"only {int(np.sum(telling))} blocks of the reference tell about {watch.parameter}: record for longer"
        return Normal(watch, 0.0, np.inf, 1.0, total / int(np.sum(telling)), None, np.inf, why)
    spread = _spread(series)
    # A machine that has grown, seen by this model, is this machine, seen by a model that has shrunk.
    echo = min((offset - _mean_change(moved)) / away, 1.0)
    if echo < _FAINTEST:
        why = (
            f"the observer of this model cannot follow {watch.parameter}: of a change only "
            f"{100 * max(echo, 0.0):.0f} % would show; measure more, or watch for more"
        )
        return Normal(watch, 0.0, np.inf, 1.0, total / int(np.sum(telling)), None, np.inf, why)
    unit_ratio = (echo * watch.growth) ** 2 / (2.0 * spread)
    evidence = weigh(information, unit_ratio, LEAST_SHARE * mean)
    offset_stderr = float(np.sqrt(spread / total))
    return Normal(watch, offset, offset_stderr, spread, evidence.ratio / unit_ratio, evidence, np.inf, echo=echo)


def _with_threshold(normal: Normal, hours: float, block: float) -> Normal:
    """The same with the threshold for one false alarm in so many hours, or why there is none."""
    if normal.evidence is None:
        return normal
    blocks, watch = 3600.0 * hours / block, normal.watch
    try:
        return replace(normal, threshold=find_threshold(blocks, normal.evidence), why="")
    except IdloopError:
        longer = needed_reference(blocks, normal.evidence)
        why = (
            f"the reference is too short to promise one false alarm in {hours:g} h for a growth of "
            f"{watch.growth:.3g} {watch.unit}: it shows {watch.parameter} to ± "
            f"{1.96 * normal.offset_stderr / normal.echo:.2g} {watch.unit}; record {longer:.1f} times as "
            "long, or watch for more"
        )
        return replace(normal, threshold=np.inf, why=why)


def weigh(information: Array, unit: float, least: float) -> Evidence:
    """Evidence of blocks.

    Parameters
    ----------
    information : array, shape (b,)
        [1/unit²].
    unit : float
        Half the squared growth over the spread: turns information into a mean log-likelihood ratio.
    least : float
        Blocks with less information tell nothing [1/unit²].
    """
    telling = np.where(information > least, information, 0.0)
    total, squares = float(np.sum(telling)), float(np.sum(telling**2))
    if total <= 0.0:
        return Evidence(1e-12, 1e-12, 0.0)
    # Blocks of unequal information are worth this many equal ones.
    alike = total**2 / squares
    return Evidence(unit * total / alike, alike / len(information), alike)


def _spread(series: list[Array]) -> float:
    """Long-run variance of normalised scores, not below that of the single block."""
    plain = sum(float(np.sum(z**2)) for z in series) / sum(len(z) for z in series)
    return max(float(long_run_covariance(series)[0, 0]), plain, 1e-12)
