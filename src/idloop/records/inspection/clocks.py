"""Statistics of stamps: rate, jitter, gaps, losses, duplicates, resets of the clock, two clocks."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from idloop.arrays import Array, Integers
from idloop.records.bags.stream import JointStream
from idloop.records.finding import Finding
from idloop.spelling import counted

_OFF_GRID = 0.3  # periods that an interval may lie beside a whole number of periods
_REGULAR = 0.9  # share of such intervals that makes a grid
_LOST = 1.5  # an interval longer than this many periods misses a sample
_GAP = 10.0  # ... and one longer than this many is reported as a gap
_REORDERED = 3.0  # a step back of at most this many periods is due to the transport, not to the clock
# Drift of two clocks [s/s] and over a recording [s]: crystal clocks agree better than the first, a busy machine delays
# messages by less than the second; beyond the third and fourth pair the streams cannot be used together.
_DRIFT_NOTED, _DRIFTED_NOTED = 5e-5, 0.02
_DRIFT_CERTAIN, _DRIFTED_CERTAIN = 1e-3, 0.1
_FIRST_DATE_NS = 10**18  # 2001-09-09: earlier stamps count from a start, not from 1970
# What to do where stamps are wrong.
_CURES = {
    "lost_samples": "record on the machine that measures, to a faster disk, or at a lower rate",
    "gap": "record again, or leave the part before or after it out",
    "clock_reset": "record one run per bag",
    "duplicate_stamps": "stamp each sample where the sensor is read",
}


@dataclass(frozen=True)
class StampStatistics:
    """Stamps of one stream in numbers."""

    count: int  # number of stamps
    # Span [s], median interval [s], its inverse [Hz]; NaN below two stamps
    duration: float
    period: float
    rate: float
    # Percentiles ``p50``, ``p95``, ``p99``, ``max`` of the deviation of an interval from the median [s]
    jitter: dict[str, float]
    regular: bool  # whether the stamps lie on a grid well enough to count losses
    lost: int  # samples missing on that grid (0 where not regular)
    # Start after the first stamp [s] and length [s] of intervals longer than ten periods
    gaps: tuple[tuple[float, float], ...]
    duplicates: int  # stamps equal to the one before
    resets: tuple[int, ...]  # indices at which the clock was set back
    reordered: int  # steps back by no more than three periods
    largest_step_back: float  # [s], 0 where time never runs backwards


def stamp_statistics(stamp_ns: Integers) -> StampStatistics:
    """Measure the stamps of one stream, shape (n,) in nanoseconds and in the order of reception."""
    received = np.diff(stamp_ns).astype(np.float64) * 1e-9
    ahead = received[received > 0]
    tolerance = _REORDERED * float(np.median(ahead)) if ahead.size else 0.0
    backward = np.flatnonzero(received < 0)
    reset = backward[received[backward] < -tolerance] + 1
    # Within a run of the clock the order of reception does not matter for rate and losses.
    runs = [np.sort(run) for run in np.split(stamp_ns, reset)]
    step = np.concatenate([np.diff(run) for run in runs]).astype(np.float64) * 1e-9
    begin = np.concatenate([run[:-1] for run in runs]) - (stamp_ns[0] if stamp_ns.size else 0)
    forward = step[step > 0]
    period = float(np.median(forward)) if forward.size else float("nan")
    spread = np.abs(forward - period)
    p50, p95, p99, largest = np.percentile(spread, [50, 95, 99, 100]) if forward.size else [np.nan] * 4
    periods = np.round(forward / period)
    on_grid = (periods >= 1) & (np.abs(forward / period - periods) < _OFF_GRID)
    regular = bool(forward.size) and bool(on_grid.mean() > _REGULAR)
    missing = np.where(forward > _LOST * period, periods - 1, 0.0)
    wide = np.flatnonzero(step > _GAP * period)
    return StampStatistics(
        count=int(stamp_ns.size),
        duration=float(np.ptp(stamp_ns)) * 1e-9 if stamp_ns.size else 0.0,
        period=period,
        rate=1.0 / period,
        jitter={"p50": float(p50), "p95": float(p95), "p99": float(p99), "max": float(largest)},
        regular=regular,
        lost=int(missing.sum()) if regular else 0,
        gaps=tuple((float(begin[k]) * 1e-9, float(step[k])) for k in wide),
        duplicates=int(np.count_nonzero(step == 0)),
        resets=tuple(int(k) for k in reset),
        reordered=int(backward.size - reset.size),
        largest_step_back=float(-received[backward].min()) if backward.size else 0.0,
    )


def while_measured(command: Integers, measured: Iterable[Integers]) -> Integers:
    """Return the stamps (m,) of a command that was sent while something was measured; all of them where none was.

    Before and after a run a controller sends zeros at a rate of its own, where a missing one does not matter.
    """
    known = [stamps for stamps in measured if stamps.size]
    if not known:
        return command
    first, last = min(int(stamps.min()) for stamps in known), max(int(stamps.max()) for stamps in known)
    inside = command[(command >= first) & (command <= last)]
    return inside if inside.size else command


def stamp_findings(
    where: str, statistics: StampStatistics, *, announced: bool = False, held: bool = False
) -> list[Finding]:
    """Return what is remarkable about the stamps of one stream.

    `where`: topic.
    `announced`: whether values are sent ahead of their time, and so may be replaced.
    `held`: whether this is a command, whose last value is assumed to hold where one is missing.
    """
    found: list[Finding] = []

    def add(kind: str, count: int, text: str, **more: Any) -> None:
        cure = _CURES.get(kind, "")
        found.append(Finding(kind, f"{where}: {text}", count, where, **{"level": "warning", "cure": cure, **more}))

    over = "; the command before is assumed to hold there" if held else ""
    resets, lost, gaps = len(statistics.resets), statistics.lost, len(statistics.gaps)
    period = f"{statistics.period * 1e3:.4g} ms"
    if resets and announced:
        text = f"values sent ahead of their time were replaced ({resets} times)"
        add("announced_anew", resets, text, level="note")
    elif resets:
        many = "once" if resets == 1 else f"{resets} times"
        first = f"first at message {statistics.resets[0]}, by up to {statistics.largest_step_back:.6g} s"
        add("clock_reset", resets, f"the clock was set back {many} ({first})")
    if statistics.reordered:
        text = f"{statistics.reordered} messages arrived out of order"
        add("out_of_order", statistics.reordered, text, level="note")
    if statistics.duplicates:
        add("duplicate_stamps", statistics.duplicates, f"{statistics.duplicates} stamps occur twice")
    if lost:
        share = lost / (lost + statistics.count)
        text = f"{lost} samples are missing on the {period} grid ({100 * share:.2g} %){over}"
        level = "warning" if share > 0.001 else "note"
        add("lost_samples", lost, text, level=level, evidence={"lost": lost, "share": share})
    if gaps:
        start, length = max(statistics.gaps, key=lambda gap: gap[1])
        text = f"{counted(gaps, 'gap')} longer than ten periods, the longest {length:.4g} s at {start:.4g} s"
        add("gap", gaps, text + ("" if lost else over), evidence={"gaps": gaps, "longest": length})
    if not statistics.regular and statistics.count > 2 and np.isfinite(statistics.period):
        within = f"95 % within {statistics.jitter['p95'] * 1e3:.3g} ms of it"
        used = "the recorded stamps are used, not the nominal period"
        add("jitter", statistics.count, f"irregular stamps, median interval {period}, {within}; {used}", level="note")
    return found


class ClockComparison(NamedTuple):
    """Stamps of two streams seen from the one clock of the recorder."""

    overlap: float  # common span of the stamps [s]; negative when they do not meet
    # Change of (first minus second) stamp at equal receive time: per second of stamps [s/s], and over the recording, in
    # seconds of the recorder's clock
    drift: float = np.nan
    drifted: float = np.nan


def compare_clocks(first: JointStream, second: JointStream) -> ClockComparison:
    """Compare the stamps of two streams for a common clock.

    The recorder receives both streams on its own clock. Where both were stamped by one clock, stamp against
    receive time is one curve for both, whatever its slope (a simulation may run faster than real time).
    """
    stamp_a, receive_a, stamp_b, receive_b = first.stamp_ns, first.receive_ns, second.stamp_ns, second.receive_ns
    overlap = 1e-9 * float(min(stamp_a.max(), stamp_b.max()) - max(stamp_a.min(), stamp_b.min()))
    start = max(int(receive_a.min()), int(receive_b.min()))
    stop = min(int(receive_a.max()), int(receive_b.max()))
    common = (receive_a >= start) & (receive_a <= stop)
    if common.sum() < 10 or stop <= start:
        return ClockComparison(overlap)
    # Differences to the first stamp keep double precision at stamps of 1.7e18 ns.
    order, zero = np.argsort(receive_b, kind="stable"), stamp_b[0]
    when, stamped = _seconds(receive_a[common], start), _seconds(stamp_a[common], zero)
    offset = stamped - np.interp(when, _seconds(receive_b[order], start), _seconds(stamp_b[order], zero))
    # Medians over the outer fifths: a hiccup of the recorder moves single samples, not these.
    edge = max(offset.size // 5, 1)
    moved, received, span = (float(np.median(x[-edge:]) - np.median(x[:edge])) for x in (offset, when, stamped))
    if span <= 0 or received <= 0:
        return ClockComparison(overlap)
    return ClockComparison(overlap, moved / span, moved * received / span)


def _seconds(stamp_ns: Integers, zero: int) -> Array:
    return np.asarray((stamp_ns - zero) * 1e-9)


def share_no_clock(first: JointStream, second: JointStream) -> bool:
    """Whether one topic has dates and the other counts from a start, as with simulated time beside receive time."""
    counted = [
        one.stamped and bool(np.median(one.stamp_ns) < _FIRST_DATE_NS <= np.median(one.receive_ns))
        for one in (first, second)
    ]
    return any(counted) and not all(counted)


def clock_finding(command: JointStream, measured: JointStream) -> Finding | None:
    """Return whether a command and a measurement were stamped by two clocks.

    Returns: of kind ``two_clocks`` where this is certain and the streams cannot be used together, ``clock_drift`` where
    the stamps drift apart by little, None for one clock.
    """
    clocks = compare_clocks(command, measured)
    drift, drifted = abs(clocks.drift), abs(clocks.drifted)
    certain = clocks.overlap < 0 or (drift > _DRIFT_CERTAIN and drifted > _DRIFTED_CERTAIN)
    if not certain and not (drift > _DRIFT_NOTED and drifted > _DRIFTED_NOTED):
        return None
    why = f"the stamps of {command.topic} and {measured.topic} drift apart by {clocks.drift * 1e3:.3g} ms per second"
    cure = "stamp both from one clock, or read with receive stamps"
    if clocks.overlap < 0:
        spans = (
            f"{one.topic} is stamped {one.stamp_ns[0] * 1e-9:.3f} to {one.stamp_ns[-1] * 1e-9:.3f} s"
            for one in (command, measured)
        )
        apart = "they do not overlap"
        if share_no_clock(command, measured):
            apart = "simulated time against the clock of the recorder"
            cure = (
                "set `use_sim_time` alike for all nodes, with stamps in every message, and record again, or import this"
                " recording with `time: {stamps: receive}`"
            )
        why = f"{', '.join(spans)}, {apart}"
    return Finding(
        "two_clocks" if certain else "clock_drift",
        f"{'' if certain else 'perhaps '}two clocks: {why}; {cure}",
        where=f"{command.topic}, {measured.topic}",
        level="warning",
        evidence={"overlap": clocks.overlap, "drift": clocks.drift},
        cure=cure,
        spoils=("identification",) if certain else ("delays",),
    )
