"""Two publishers on one topic: two sequences of messages that are interleaved and contradict each other."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from idloop.arrays import Array, Integers, Mask
from idloop.records.bags.stream import JointStream

Evidence = Literal["clocks", "fields", "stamps"]

_FEWEST = 4  # messages of the rarer publisher, and changes between the two
_ON_GRID = 0.1  # periods that a stamp may lie beside the next point of a grid
_EXPLAINED = 0.95  # share of the stamps that two grids must explain
_OPENING = 4000  # messages among which a grid is looked for
_CONTRADICTION = 5.0  # times the error of interpolation within one sequence
_GAP = 3.0  # times the spread of either clock


@dataclass(frozen=True, eq=False)
class Publishers:
    """Two sequences within the messages of one topic."""

    topic: str
    evidence: Evidence  # what tells them apart: two clocks, different joints or fields, or two grids of stamps
    second: Mask  # shape (n,): messages of the rarer sequence
    clock_offset: float  # median of its stamp minus receive time, minus that of the other [s]
    # Signals, such as ``motor.position``, of which the sequences hold different values at the same time; empty only
    # where `evidence` is ``"clocks"``
    contradicting: tuple[str, ...]

    @property
    def counts(self) -> tuple[int, int]:
        """Messages of the more frequent and of the rarer sequence."""
        rarer = int(self.second.sum())
        return self.second.size - rarer, rarer


def find_publishers(stream: JointStream) -> Publishers | None:
    """Tell whether two publishers sent the messages of a topic.

    A single publisher may leave out joints, deliver late or keep an uneven rhythm. Two are therefore named only where
    stamps jump back and forth between two clocks, or where two sequences, told apart by their fields or by the grids of
    their stamps, hold different values of one signal at the same time.

    `stream`: all messages of the topic in the order of reception.
    Returns: None for a single publisher, and for two that agree and share a clock.
    """
    if len(stream) < 4 * _FEWEST:
        return None
    columns = stream.columns()
    ahead = (stream.stamp_ns - stream.receive_ns) * 1e-9
    for evidence, second in _sequences(stream, columns):
        clocks = evidence == "clocks"
        contradicting = _contradicting(stream.receive_ns if clocks else stream.stamp_ns, columns, second)
        if clocks or contradicting:
            offset = float(np.median(ahead[second]) - np.median(ahead[~second]))
            return Publishers(stream.topic, evidence, second, offset, contradicting)
    return None


def _sequences(stream: JointStream, columns: dict[str, Array]) -> Iterator[tuple[Evidence, Mask]]:
    """Rarer messages of two sequences that alternate, and what tells them apart; likeliest first."""
    if stream.stamped and (found := _two_clocks(stream)) is not None:
        yield "clocks", found
    if stream.is_joint_state and (found := _rarer(_other_fields(columns))) is not None:
        yield "fields", found
    for grid in _other_grids(stream.stamp_ns, list(columns.values())):
        if (found := _rarer(grid)) is not None:
            yield "stamps", found


def _rarer(second: Mask) -> Mask | None:
    """Mask of the rarer sequence; None where the two do not alternate."""
    changes = np.count_nonzero(np.diff(second))
    rarer = min(second.sum(), second.size - second.sum())
    # Messages in long runs are those of one publisher that has changed its rate.
    if changes < max(_FEWEST, rarer) or rarer < _FEWEST:
        return None
    return ~second if 2 * int(second.sum()) > second.size else second


def _two_clocks(stream: JointStream) -> Mask | None:
    """Messages whose stamps are of another clock, with the stamps jumping back and forth between both."""
    stamp = stream.stamp_ns
    back = int(np.count_nonzero(np.diff(stamp) < 0))
    if back < _FEWEST:
        return None
    ahead = stamp - stream.receive_ns
    order = np.sort(ahead)
    widest = int(np.argmax(np.diff(order)))
    gap = int(order[widest + 1] - order[widest])
    second = _rarer(ahead > order[widest])
    if second is None:
        return None
    parts = stamp[second], stamp[~second]
    spread = max(int(np.ptp(np.quantile(ahead[mask], (0.05, 0.95)))) for mask in (second, ~second))
    if gap < _GAP * spread or sum(int(np.count_nonzero(np.diff(part) < 0)) for part in parts) > back // 10:
        return None
    return None if _fills_the_gaps(*parts) else second


def _fills_the_gaps(late: Integers, others: Integers) -> bool:
    """Whether the stamps of messages that came late are those missing on the one grid of a single publisher."""
    inside = late[(late > others[0]) & (late < others[-1])]
    if inside.size < late.size // 2:
        return False
    period = float(np.median(np.diff(np.sort(np.concatenate([late, others])))))
    after = np.searchsorted(others, inside)
    nearest = np.minimum(others[after] - inside, inside - others[after - 1])
    return bool(period > 0 and np.median(nearest) > (1 - 2 * _ON_GRID) * period)


def _other_fields(columns: dict[str, Array]) -> Mask:
    """Messages that carry other signals than most do."""
    if not columns:
        return np.zeros(0, dtype=np.bool_)
    given = ~np.isnan(np.column_stack(list(columns.values())))
    if np.all(given == given[:1]):
        return np.zeros(len(given), dtype=np.bool_)
    _, which, counts = np.unique(given, axis=0, return_inverse=True, return_counts=True)
    return np.asarray(which.ravel() != np.argmax(counts))


def _other_grids(stamp: Integers, columns: list[Array]) -> Iterator[Mask]:
    """Messages beside a grid of stamps on which the others lie, where these form one as well; likeliest first."""
    if np.any(np.diff(stamp) < 0):
        return
    opening = stamp[:_OPENING]
    grids: list[tuple[int, float, int]] = []
    for period in _periods(opening):
        for start in range(3):
            on_grid = _chain(opening, period, start)
            rest = opening[~on_grid]
            if rest.size < _FEWEST or on_grid.sum() < _FEWEST:
                continue
            every = float(np.median(np.diff(rest)))
            if every < _ON_GRID * period:
                continue
            explained = int(on_grid.sum()) + int(_chain(rest, every, 0).sum())
            if explained >= _EXPLAINED * opening.size:
                grids.append((-explained, period, start))
    for _, period, start in sorted(grids):
        yield _matched_twins(~_chain(stamp, period, start), stamp, columns)


def _periods(stamp: Integers) -> list[float]:
    """Periods that the grid of one of two publishers may have [ns]: the commonest steps over one to three messages."""
    found = []
    for over in (1, 2, 3):
        step = (stamp[over:] - stamp[:-over]).astype(np.float64)
        step = step[step > 0]
        if step.size:
            width = 0.02 * float(np.median(step))
            bins, counts = np.unique(np.round(step / width), return_counts=True)
            near = np.abs(step / width - bins[np.argmax(counts)]) <= 1.0
            found.append(float(np.median(step[near])))
    return found


def _chain(stamp: Integers, period: float, start: int) -> Mask:
    """Follow a grid from one message to the next; points without a message are passed over."""
    chosen = np.zeros(stamp.size, dtype=np.bool_)
    tolerance = _ON_GRID * period
    # Even stamps need no search.
    steps = np.diff(stamp)
    step = float(np.median(steps)) if steps.size else 0.0
    each = round(period / step) if step > 0.0 else 0
    if each:
        off = abs(period - each * step) + each * float(np.max(np.abs(steps - step)))
        if off <= min(tolerance, _ON_GRID * step):
            chosen[start::each] = True
            return chosen
    times = stamp.tolist()
    expected = float(times[start]) if start < len(times) else 0.0
    for row in range(start, len(times)):
        beside = times[row] - expected
        if beside > tolerance:  # points were passed over
            expected += period * round(beside / period)
            beside = times[row] - expected
        following = times[row + 1] - expected if row + 1 < len(times) else np.inf
        if abs(beside) <= tolerance and abs(beside) <= abs(following):  # else the next message is nearer to the point
            chosen[row] = True
            expected = times[row] + period
    return chosen


def _matched_twins(second: Mask, stamp: Integers, columns: list[Array]) -> Mask:
    """Of two messages with one stamp give each to the sequence that it continues: they arrive in any order."""
    twins = np.flatnonzero((np.diff(stamp) == 0) & (second[1:] != second[:-1]))
    if not twins.size or not columns:
        return second
    apart = [float(np.nanmedian(np.abs(column[twins + 1] - column[twins]))) for column in columns]
    values = columns[int(np.nanargmax(apart))] if np.isfinite(apart).any() else columns[0]
    known = np.nan_to_num(values)
    result: Mask = second.copy()
    last = np.flatnonzero(~second[: twins[0] + 2])
    at = float(known[last[-1]]) if last.size else 0.0
    for row in twins.tolist():
        first_continues = abs(known[row] - at) <= abs(known[row + 1] - at)
        result[row], result[row + 1] = not first_continues, first_continues
        at = float(known[row if first_continues else row + 1])
    return result


def _contradicting(time_ns: Integers, columns: dict[str, Array], second: Mask) -> tuple[str, ...]:
    """Signals of which the rarer sequence is far from the other, as interpolated to the same time."""
    time = (time_ns - time_ns[0]).astype(np.float64)
    found = []
    for name, values in columns.items():
        known = np.isfinite(values)
        own, other = known & ~second, known & second
        if own.sum() < 2 * _FEWEST or other.sum() < _FEWEST:
            continue
        usual = _between(time[own], values[own])
        apart = np.abs(values[other] - np.interp(time[other], time[own], values[own]))
        scale = float(np.quantile(usual, 0.95)) if usual.size else 0.0
        least = 1e-9 * (1.0 + float(np.max(np.abs(values[known]))))
        if float(np.median(apart)) > max(_CONTRADICTION * scale, least):
            found.append(name)
    return tuple(found)


def _between(time: Array, values: Array) -> Array:
    """Distance of each value from the line between its neighbours."""
    span = np.maximum(time[2:] - time[:-2], 1.0)
    share = (time[1:-1] - time[:-2]) / span
    return np.asarray(np.abs(values[1:-1] - (values[:-2] + share * (values[2:] - values[:-2]))))
