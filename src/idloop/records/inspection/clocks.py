"""What stamps tell: rate, jitter, gaps, losses, duplicates, resets of the clock, two clocks."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from idloop.records.finding import Finding

Stamps = NDArray[np.int64]

_OFF_GRID = 0.3  # periods that an interval may lie beside a whole number of periods
_REGULAR = 0.9  # share of such intervals that makes a grid
_LOST = 1.5  # an interval longer than this many periods misses a sample
_GAP = 10.0  # ... and longer than this many is a gap worth naming
_REORDERED = 3.0  # a step back of at most this many periods is the transport's doing, not the clock's


@dataclass(frozen=True)
class StampStatistics:
    """Stamps of one stream in numbers.

    Attributes
    ----------
    count : int
        Number of stamps.
    duration, period, rate : float
        Span [s], median interval [s], its inverse [Hz]; NaN below two stamps.
    jitter : dict of str to float
        Percentiles ``p50``, ``p95``, ``p99``, ``max`` of the deviation of an interval from the median [s].
    regular : bool
        Whether the stamps lie on a grid well enough to count losses.
    lost : int
        Samples missing on that grid (0 where not regular).
    gaps : tuple of (float, float)
        Start after the first stamp [s] and length [s] of intervals longer than ten periods.
    duplicates : int
        Stamps equal to the one before.
    resets : tuple of int
        Indices at which the clock was set back.
    reordered : int
        Steps back by no more than three periods.
    largest_step_back : float
        [s], 0 where time never runs backwards.
    """

    count: int
    duration: float
    period: float
    rate: float
    jitter: dict[str, float]
    regular: bool
    lost: int
    gaps: tuple[tuple[float, float], ...]
    duplicates: int
    resets: tuple[int, ...]
    reordered: int
    largest_step_back: float

    def to_dict(self) -> dict[str, object]:
        """Return plain values for JSON."""
        return asdict(self)


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
    """Stamps of a command that was given while something was measured; all of them where none was.

    Before and after a run a controller sends its zeros on a grid of their own, and nothing asks whether one is missing.

    Parameters
    ----------
    command : ndarray of int64, shape (n,)
        [ns].
    measured : iterable of ndarray of int64
        Stamps of each measured stream [ns].

    Returns
    -------
    ndarray of int64, shape (m,)
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
    """Put what is remarkable about the stamps of one stream into words.

    Parameters
    ----------
    where : str
        Topic.
    statistics : StampStatistics
    announced : bool
        Whether the sender announces values ahead of the clock, and so may take them back.
    held : bool
        Whether this is a command, whose last value is taken to hold where one is missing.
    """
    over = "; the last command before is taken to hold there" if held else ""
    found: list[Finding] = []
    if statistics.resets and announced:
        text = f"{where}: values that were announced ahead were announced anew {len(statistics.resets)} times"
        found.append(Finding("announced_anew", text, len(statistics.resets), where))
    elif statistics.resets:
        found.append(
            Finding(
                "clock_reset",
                f"{where}: the clock was set back {len(statistics.resets)} times (first at message"
                f" {statistics.resets[0]}, "
                f"by up to {statistics.largest_step_back:.6g} s)",
                len(statistics.resets),
                where,
                "warning",
            )
        )
    if statistics.reordered:
        found.append(
            Finding(
                "out_of_order",
                f"{where}: {statistics.reordered} messages arrived out of order",
                statistics.reordered,
                where,
            )
        )
    if statistics.duplicates:
        found.append(
            Finding(
                "duplicate_stamps",
                f"{where}: {statistics.duplicates} stamps occur twice",
                statistics.duplicates,
                where,
                "warning",
            )
        )
    if statistics.lost:
        share = statistics.lost / (statistics.lost + statistics.count)
        found.append(
            Finding(
                "lost_samples",
                f"{where}: {statistics.lost} samples missing on the {statistics.period * 1e3:.4g} ms grid"
                f" ({100 * share:.2g} %){over}",
                statistics.lost,
                where,
                "warning" if share > 0.001 else "note",
            )
        )
    if statistics.gaps:
        start, length = max(statistics.gaps, key=lambda gap: gap[1])
        found.append(
            Finding(
                "gap",
                f"{where}: {len(statistics.gaps)} gaps longer than ten periods, the longest {length:.4g} s at"
                f" {start:.4g} s{'' if statistics.lost else over}",
                len(statistics.gaps),
                where,
                "warning",
            )
        )
    if not statistics.regular and statistics.count > 2 and np.isfinite(statistics.period):
        found.append(
            Finding(
                "jitter",
                f"{where}: irregular stamps, median interval {statistics.period * 1e3:.4g} ms, 95 % within "
                f"{statistics.jitter['p95'] * 1e3:.3g} ms of it; the stamps themselves are used, never the"
                " nominal period",
                statistics.count,
                where,
            )
        )
    return found


@dataclass(frozen=True)
class ClockComparison:
    """Stamps of two streams seen from the one clock of the recorder.

    Attributes
    ----------
    overlap : float
        Common span of the stamps [s]; negative when they do not meet.
    offset : float
        Median of (first minus second) stamp at equal receive time [s].
    drift : float
        Change of that offset per second of stamps [s/s].
    drifted : float
        Change of that offset over the recording, in seconds of the recorder's clock.
    """

    overlap: float
    offset: float
    drift: float
    drifted: float


def compare_clocks(first: tuple[Stamps, Stamps], second: tuple[Stamps, Stamps]) -> ClockComparison:
    """Compare two streams, each (stamp_ns, receive_ns), for a common clock.

    The recorder receives both streams on its own clock. Where both were stamped by one clock, stamp against
    receive time is one curve for both, whatever its slope (a simulation may run faster than real time).
    """
    (stamp_a, receive_a), (stamp_b, receive_b) = first, second
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
