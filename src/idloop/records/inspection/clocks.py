"""Statistics of stamps: rate, jitter, gaps, losses, duplicates, resets of the clock, two clocks."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from idloop.records.bags.stamp_clock import share_no_clock
from idloop.records.bags.stream import JointStream
from idloop.records.finding import Finding

Stamps = NDArray[np.int64]

_OFF_GRID = 0.3  # periods that an interval may lie beside a whole number of periods
_REGULAR = 0.9  # share of such intervals that makes a grid
_LOST = 1.5  # an interval longer than this many periods misses a sample
_GAP = 10.0  # ... and one longer than this many is reported as a gap
_REORDERED = 3.0  # a step back of at most this many periods is due to the transport, not to the clock
# Drift of two clocks [s/s] and over a recording [s]: crystal clocks agree better than the first, a busy machine delays
# messages by less than the second; beyond the third and fourth pair the streams cannot be used together.
_DRIFT_NOTED, _DRIFTED_NOTED = 5e-5, 0.02
_DRIFT_CERTAIN, _DRIFTED_CERTAIN = 1e-3, 0.1
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


def stamp_statistics(stamp_ns: Stamps) -> StampStatistics:
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


def while_measured(command: Stamps, measured: Iterable[Stamps]) -> Stamps:
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

    def add(
        kind: str,
        count: int,
        text: str,
        level: Literal["note", "warning"] = "warning",
        evidence: Mapping[str, float] | None = None,
    ) -> None:
        cure, said = _CURES.get(kind, ""), f"{where}: {text}"
        found.append(Finding(kind, said, count, where, level, evidence=dict(evidence or {}), cure=cure))

    over = "; the command before is assumed to hold there" if held else ""
    resets, lost, gaps = len(statistics.resets), statistics.lost, len(statistics.gaps)
    if resets and announced:
        add("announced_anew", resets, f"values sent ahead of their time were replaced ({resets} times)", "note")
    elif resets:
        many = "once" if resets == 1 else f"{resets} times"
        text = f"the clock was set back {many} (first at message {statistics.resets[0]}, by up to"
        add("clock_reset", resets, f"{text} {statistics.largest_step_back:.6g} s)")
    if statistics.reordered:
        add("out_of_order", statistics.reordered, f"{statistics.reordered} messages arrived out of order", "note")
    if statistics.duplicates:
        add("duplicate_stamps", statistics.duplicates, f"{statistics.duplicates} stamps occur twice")
    if lost:
        share = lost / (lost + statistics.count)
        text = f"{lost} samples are missing on the {statistics.period * 1e3:.4g} ms grid ({100 * share:.2g} %){over}"
        add("lost_samples", lost, text, "warning" if share > 0.001 else "note", {"lost": lost, "share": share})
    if gaps:
        start, length = max(statistics.gaps, key=lambda gap: gap[1])
        many = "1 gap" if gaps == 1 else f"{gaps} gaps"
        text = f"{many} longer than ten periods, the longest {length:.4g} s at {start:.4g} s"
        add("gap", gaps, text + ("" if lost else over), evidence={"gaps": gaps, "longest": length})
    if not statistics.regular and statistics.count > 2 and np.isfinite(statistics.period):
        text = (
            f"irregular stamps, median interval {statistics.period * 1e3:.4g} ms, 95 % within"
            f" {statistics.jitter['p95'] * 1e3:.3g} ms of it; the recorded stamps are used, not the nominal period"
        )
        add("jitter", statistics.count, text, "note")
    return found


@dataclass(frozen=True)
class ClockComparison:
    """Stamps of two streams seen from the one clock of the recorder."""

    overlap: float  # common span of the stamps [s]; negative when they do not meet
    offset: float  # median of (first minus second) stamp at equal receive time [s]
    drift: float  # change of that offset per second of stamps [s/s]
    drifted: float  # change of that offset over the recording, in seconds of the recorder's clock


def compare_clocks(first: JointStream, second: JointStream) -> ClockComparison:
    """Compare the stamps of two streams for a common clock.

    The recorder receives both streams on its own clock. Where both were stamped by one clock, stamp against
    receive time is one curve for both, whatever its slope (a simulation may run faster than real time).
    """
    stamp_a, receive_a = first.stamp_ns, first.receive_ns
    stamp_b, receive_b = second.stamp_ns, second.receive_ns
    overlap = float(min(stamp_a.max(), stamp_b.max()) - max(stamp_a.min(), stamp_b.min())) * 1e-9
    order = np.argsort(receive_b, kind="stable")
    start = max(int(receive_a.min()), int(receive_b.min()))
    stop = min(int(receive_a.max()), int(receive_b.max()))
    common = (receive_a >= start) & (receive_a <= stop)
    if common.sum() < 10 or stop <= start:
        return ClockComparison(overlap, float("nan"), float("nan"), float("nan"))
    # Differences to the first stamp keep double precision at stamps of 1.7e18 ns.
    zero = stamp_b[0]
    expected = np.interp(
        (receive_a[common] - start).astype(np.float64),
        (receive_b[order] - start).astype(np.float64),
        (stamp_b[order] - zero).astype(np.float64) * 1e-9,
    )
    when = (receive_a[common] - start).astype(np.float64) * 1e-9
    offset = (stamp_a[common] - zero).astype(np.float64) * 1e-9 - expected
    # Medians over the outer fifths: a hiccup of the recorder moves single samples, not these.
    edge = max(offset.size // 5, 1)
    moved = float(np.median(offset[-edge:]) - np.median(offset[:edge]))
    span_receive = float(np.median(when[-edge:]) - np.median(when[:edge]))
    stamped = (stamp_a[common] - stamp_a[common][0]).astype(np.float64) * 1e-9
    span_stamp = float(np.median(stamped[-edge:]) - np.median(stamped[:edge]))
    if span_stamp <= 0 or span_receive <= 0:
        return ClockComparison(overlap, float(np.median(offset)), float("nan"), float("nan"))
    return ClockComparison(
        overlap=overlap,
        offset=float(np.median(offset)),
        drift=moved / span_stamp,
        drifted=moved * span_receive / span_stamp,
    )


def clock_finding(command: JointStream, measured: JointStream) -> Finding | None:
    """Return whether a command and a measurement were stamped by two clocks.

    Returns: of kind ``two_clocks`` where this is certain and the streams cannot be used together, ``clock_drift`` where
    the stamps drift apart by little, None for one clock.
    """
    clocks = compare_clocks(command, measured)
    names = f"{command.topic} and {measured.topic}"
    drift, drifted = abs(clocks.drift), abs(clocks.drifted)
    text = f"the stamps of {names} drift apart by {clocks.drift * 1e3:.3g} ms per second"
    advice = "; stamp both from one clock, or read with receive stamps"
    if clocks.overlap < 0:
        spans = (
            f"{one.topic} is stamped {one.stamp_ns[0] * 1e-9:.3f} to {one.stamp_ns[-1] * 1e-9:.3f} s"
            for one in (command, measured)
        )
        if share_no_clock(command, measured):
            advice = (
                "; set `use_sim_time` alike for all nodes, with stamps in every message, and record again, or import"
                " this recording with `time: {stamps: receive}`"
            )
            why = "simulated time against the clock of the recorder"
        else:
            why = "they do not overlap"
        kind, text = "two_clocks", f"two clocks: {', '.join(spans)}, {why}{advice}"
    elif drift > _DRIFT_CERTAIN and drifted > _DRIFTED_CERTAIN:
        kind, text = "two_clocks", f"two clocks: {text}{advice}"
    elif drift > _DRIFT_NOTED and drifted > _DRIFTED_NOTED:
        kind, text = "clock_drift", f"perhaps two clocks: {text}{advice}"
    else:
        return None
    return Finding(
        kind,
        text,
        where=f"{command.topic}, {measured.topic}",
        level="warning",
        evidence={"overlap": clocks.overlap, "drift": clocks.drift},
        cure=advice.removeprefix("; "),
        spoils=("identification",) if kind == "two_clocks" else ("delays",),
    )
