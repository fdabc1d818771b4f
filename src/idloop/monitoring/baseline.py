"""The healthy reference of a monitor: statistics of a fitted model on healthy records, and alarm thresholds."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from idloop.arrays import Array
from idloop.errors import IdloopError, InputError
from idloop.estimation.dataset import prepare
from idloop.estimation.optimisation.caching_engine import CachingEngine
from idloop.estimation.statistics.covariance import long_run_covariance
from idloop.monitoring.block_scores import EfficientScore, Scores, block_scores, efficient_score, join
from idloop.monitoring.reference_observer import ReferenceObserver, design_reference_observer
from idloop.monitoring.run_length import Evidence, detection_delay, find_threshold, needed_reference
from idloop.monitoring.watch import USUAL_HOURS, Watch, may_vary

if TYPE_CHECKING:
    from idloop.physics import Model
    from idloop.records import Record

Progress = Callable[[float, str], None]

BLOCK = 2.0  # [s]
# Fewest informative blocks from which offset and variance are estimated.
FEWEST = 20
# A block is informative when it has at least this share of the reference's mean information.
LEAST_SHARE = 0.02
# Least sensitivity: below it what the scores show may come from another cause.
_FAINTEST = 0.1
# Records are processed in stretches of this length [s].
_STRETCH = 120.0
# Step for the slopes of parameters that may vary, as a share of their value.
_STEP = 0.1


@dataclass(frozen=True)
class ReferenceStatistics:
    """Statistics of one watch on the healthy reference."""

    watch: Watch
    # Change against the model that the reference itself shows [unit]
    offset: float
    offset_stderr: float
    variance_ratio: float  # long-run variance of the scores over that with white innovations
    information: float  # mean information of an informative block [1/unit²]
    evidence: Evidence | None  # None where the reference is not informative enough
    threshold: float  # alarm threshold of the CUSUM; infinite where no alarm is possible
    why: str = ""  # reason why no alarm is possible; empty where one is
    # Share of a change that the scores show: 1 with a known state, less where noise of the estimated state enlarges the
    # slopes
    sensitivity: float = 1.0

    def ratio(self, score: EfficientScore) -> Array:
        """Log-likelihood ratio of the watched growth against no growth, for each block (b,)."""
        growth = self.sensitivity * self.watch.growth
        centred = score.gradient - score.information * self.offset
        return np.asarray((growth * centred - 0.5 * growth**2 * score.information) / self.variance_ratio)


@dataclass(frozen=True)
class Baseline:
    """Model, observer and reference statistics of a monitor."""

    model: Model  # its free parameters are those that are watched or may vary
    watches: tuple[Watch, ...]
    varying: tuple[str, ...]  # parameters that may change without being wear
    false_alarm_hours: float  # running time between two false alarms of all watches together [h]
    block: float  # length of a block [s]
    observer: ReferenceObserver
    normal: tuple[ReferenceStatistics, ...]  # one for each watch
    duration: float  # of the reference [s]

    @cached_property
    def engine(self) -> CachingEngine:
        """The model, compiled."""
        return CachingEngine(self.model)

    def __getstate__(self) -> dict[str, object]:
        """Leave out the compiled model, which cannot be pickled."""
        return {name: value for name, value in self.__dict__.items() if name != "engine"}

    def scores(self, record: Record) -> Scores:
        """Scores of the whole blocks of a record, on the grid of its absolute clock.

        Raises InputError: the record does not suit the model, or was sampled at another rate than the reference.
        """
        return join([self._stretch(part) for part in self._stretches(record)])

    def _stretches(self, record: Record) -> Iterator[Record]:
        """Parts of a long record that overlap by the settling time of the observer, to bound memory."""
        start, end = float(record.time[0]), float(record.time[-1])
        warm = self.settling + self.block
        while True:
            stop = start + max(_STRETCH, 4.0 * warm)
            # The last part takes in a short rest, which could be too short for a part of its own.
            last = stop + warm >= end
            yield record.cut(start, end if last else stop)
            if last:
                return
            start = stop - warm

    def _stretch(self, record: Record) -> Scores:
        (data,) = prepare(self.model, [record], keep_computed=True)
        if abs(data.sample_time - self.observer.sample_time) > 0.05 * self.observer.sample_time:
            raise InputError(
                f"record {record.name!r} is sampled every {data.sample_time:.4g} s, the reference every "
                f"{self.observer.sample_time:.4g} s: record at the same rate"
            )
        steps = step_sizes(self.model, self.watches)
        # The grid is that of the absolute clock, so that a record cut in two has the same blocks.
        first, past = divmod(record.start_ns, round(self.block * 1e9))
        found = block_scores(self.engine, self.observer, self.model.theta, steps, data, self.block, -past * 1e-9)
        return replace(found, index=found.index + first)

    @property
    def settling(self) -> float:
        """Settling time of the observer [s]."""
        longest = max(whitener.order for whitener in self.observer.whiteners)
        return float((self.observer.memory + longest) * self.observer.sample_time)

    def end_of(self, block: int) -> int:
        """Absolute stamp of the end of a block [ns]."""
        return (block + 1) * round(self.block * 1e9)

    def efficient_score(self, scores: Scores) -> list[EfficientScore]:
        """Efficient score of each watch: independent of changes of the other parameters."""
        steps = step_sizes(self.model, self.watches)
        return [efficient_score(scores, self.model.free.index(w.parameter), np.abs(steps)) for w in self.watches]

    def with_false_alarm_hours(self, false_alarm_hours: float) -> Baseline:
        """Return the baseline with the thresholds for another running time between false alarms [h].

        Raises InputError: it is not positive.
        """
        if not 0.0 < false_alarm_hours < np.inf:
            raise InputError("the time between two false alarms must be positive")
        hours = false_alarm_hours * len(self.watches)
        normal = tuple(_with_threshold(one, hours, self.block) for one in self.normal)
        return replace(self, false_alarm_hours=false_alarm_hours, normal=normal)

    def delay(self, which: int, evidence: Evidence | None = None) -> float:
        """Expected time from a sudden growth of the watched size to its alarm [s].

        `which`: number of the watch. `evidence`: of the data that are monitored; of the reference by default.
        """
        normal, known = self.normal[which], evidence or self.normal[which].evidence
        if known is None or not np.isfinite(normal.threshold):
            return float("inf")
        return self.block * detection_delay(normal.threshold, known)


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
    """Compute the baseline from records of the healthy machine, in the motions in which it will be monitored.

    `model`: fitted to the machine; growth is counted from its values. `varying`: parameters that may change without
    being wear, beside viscous friction. `false_alarm_hours`: running time between two false alarms of all watches
    together [h]. `block`: length of a block [s]. `progress`: called with the share done in [0, 1] and a short text.
    Raises InputError: the records do not suit the model, or each is shorter than a block.
    Raises IdloopError: no observer can be designed.
    """
    if not 0.0 < block < np.inf:
        raise InputError("the length of a block must be positive")
    report = progress or (lambda share, text: None)
    others = may_vary(model, watches, varying)
    free = model.with_free([*(watch.parameter for watch in watches), *others])
    data = prepare(free, records, keep_computed=True)
    report(0.0, "the observer")
    observer = design_reference_observer(CachingEngine(free), data, free.theta)
    bare = Baseline(
        free, tuple(watches), others, false_alarm_hours, block, observer, (), sum(r.duration for r in records)
    )
    found = []
    for number, record in enumerate(records):
        report(0.5 + 0.5 * number / len(records), "the reference")
        found.append(bare.efficient_score(bare.scores(record)))
    if not any(len(one[0].gradient) for one in found):
        raise InputError(
            f"the reference has no whole block of {block:g} s after the settling time of the observer, "
            f"{bare.settling:.2g} s: make a longer recording"
        )
    normal = tuple(
        _normal(watch, [one[i] for one in found], [one[i] for one in _moved(bare, watch, records)], _away(free, watch))
        for i, watch in enumerate(watches)
    )
    return replace(bare, normal=normal).with_false_alarm_hours(false_alarm_hours)


def _away(model: Model, watch: Watch) -> float:
    """Change of the model against which the healthy machine looks worn: minus the growth, or plus it at a bound."""
    known = model.parameter(watch.parameter)
    return -watch.growth if known.min <= known.value - watch.growth <= known.max else watch.growth


def _moved(bare: Baseline, watch: Watch, records: Sequence[Record]) -> list[list[EfficientScore]]:
    """Efficient scores of the healthy records with the watched parameter of the model changed."""
    model = bare.model.with_values({watch.parameter: watch.value + _away(bare.model, watch)})
    other = replace(bare, model=model)
    return [other.efficient_score(other.scores(record)) for record in records]


def _mean_change(records: list[EfficientScore]) -> float:
    """Change that all blocks together show, before the correction by the sensitivity [unit]."""
    total = sum(float(np.sum(one.information)) for one in records)
    return sum(float(np.sum(one.gradient)) for one in records) / max(total, 1e-300)


def _normal(
    watch: Watch, records: list[EfficientScore], moved: list[EfficientScore], away: float
) -> ReferenceStatistics:
    """Reference statistics of one watch without threshold; `moved` is with its parameter changed by `away`."""
    information = np.concatenate([one.information for one in records])
    total, least = float(np.sum(information)), LEAST_SHARE * float(np.mean(information))
    informative = int(np.sum(information > least))

    def undecidable(why: str, known: float = total / max(informative, 1)) -> ReferenceStatistics:
        return ReferenceStatistics(watch, 0.0, np.inf, 1.0, known, None, np.inf, why)

    if not np.mean(information) * watch.growth**2 > 1e-9 or informative < 2:
        nothing = f"the reference contains no information about {watch.parameter}: its motion does not excite it"
        return undecidable(nothing, 0.0)
    offset = _mean_change(records)
    kept = [(one, one.information > least) for one in records]
    normalised = [(one.gradient - one.information * offset)[k] / np.sqrt(one.information[k]) for one, k in kept]
    series = [z[:, None] for z in normalised if len(z) > 2]
    if sum(map(len, series)) < FEWEST:
        return undecidable(
            f"only {informative} blocks of the reference are informative about {watch.parameter}: make a longer"
            " recording"
        )
    # Not below the variance of the single block.
    single = float(np.mean(np.concatenate(series) ** 2))
    variance_ratio = max(float(long_run_covariance(series)[0, 0]), single, 1e-12)
    # A grown parameter of the machine looks like a reduced one of the model.
    sensitivity = min((offset - _mean_change(moved)) / away, 1.0)
    if sensitivity < _FAINTEST:
        return undecidable(
            f"the observer shows only {100 * max(sensitivity, 0.0):.0f} % of a change of {watch.parameter}: "
            "measure more outputs, or watch for a larger growth"
        )
    unit = (sensitivity * watch.growth) ** 2 / (2.0 * variance_ratio)
    seen = information[information > least]
    # Number of blocks of equal information that are worth as much.
    alike = float(np.sum(seen) ** 2 / np.sum(seen**2))
    mean = float(np.sum(seen)) / alike
    evidence = Evidence(unit * mean, alike / len(information), alike)
    offset_stderr = float(np.sqrt(variance_ratio / total))
    return ReferenceStatistics(
        watch, offset, offset_stderr, variance_ratio, mean, evidence, np.inf, sensitivity=sensitivity
    )


def _with_threshold(normal: ReferenceStatistics, hours: float, block: float) -> ReferenceStatistics:
    """Set the threshold for one false alarm in so many hours, or the reason why there is none."""
    if normal.evidence is None:
        return normal
    blocks, watch = 3600.0 * hours / block, normal.watch
    try:
        return replace(normal, threshold=find_threshold(blocks, normal.evidence), why="")
    except IdloopError:
        longer = needed_reference(blocks, normal.evidence)
        why = (
            f"the reference is too short for one false alarm in {hours:g} h with a growth of "
            f"{watch.growth:.3g} {watch.unit}: it determines {watch.parameter} to ± "
            f"{1.96 * normal.offset_stderr / normal.sensitivity:.2g} {watch.unit}; record {longer:.1f} times as "
            "long, or watch for a larger growth"
        )
        return replace(normal, threshold=np.inf, why=why)
