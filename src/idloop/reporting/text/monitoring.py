"""A watch for wear in words: what is promised, the state of every watch, every alarm."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

from idloop.reporting.text.blocks import Block, Table, number

if TYPE_CHECKING:
    from idloop.monitoring import Baseline, Trace, WatchState
    from idloop.records import Record

_MOST_ALARMS = 12  # in the table; the JSON document has all


def _interval(growth: Any) -> str:
    return f"{growth.low:.3g} .. {growth.high:.3g}"


_STATES: dict[str, Callable[[WatchState], str]] = {
    "watched": lambda state: state.parameter,
    "unit": lambda state: state.unit,
    "healthy": lambda state: number(state.value),
    "noticed": lambda state: f"{state.watched:+.3g}",
    "state": lambda state: state.state.replace("_", " "),
    "newest growth": lambda state: "-" if state.growth is None else f"{state.growth.value:+.3g}",
    "95 %": lambda state: "-" if state.growth is None else _interval(state.growth),
    "delay here s": lambda state: number(state.delay, 3),
    "in reference s": lambda state: number(state.reference_delay, 3),
}
_ALARMS: dict[str, Callable[[dict[str, Any]], str]] = {
    "record": lambda alarm: alarm["record"],
    "alarm at s": lambda alarm: f"{alarm['time']:.1f}",
    "since s": lambda alarm: f"{alarm['onset']:.1f}",
    "watched": lambda alarm: alarm["parameter"],
    "growth by then": lambda alarm: number(alarm["growth"].value, 3),
    "95 %": lambda alarm: _interval(alarm["growth"]),
    "unit": lambda alarm: alarm["unit"],
}


def alarm_rows(baseline: Baseline, records: Sequence[Record], traces: Sequence[Trace]) -> list[dict[str, Any]]:
    """Every alarm with the record in which it was raised, in order; times on the record's own clock [s]."""

    def seconds(record: Record, block: int) -> float:
        return (baseline.end_of(block) - record.start_ns) * 1e-9

    rows = []
    for record, trace in zip(records, traces, strict=True):
        start = float(record.time[0])
        first = int(trace.index[0]) if len(trace.index) else 0
        for block, which, alarm in trace.alarms:
            watch = baseline.watches[which]
            rows.append({
                "record": record.name,
                "parameter": watch.parameter,
                "unit": watch.unit,
                "time": seconds(record, block),
                # A sum may have begun to rise in the record before.
                "onset": seconds(record, max(first, alarm.onset) - 1) if alarm.onset <= block else start,
                "growth": alarm.growth,
            })  # fmt: skip
    return rows


def monitoring_blocks(
    baseline: Baseline, states: Sequence[WatchState], records: Sequence[Record], traces: Sequence[Trace]
) -> Iterator[Block]:
    """Yield what is promised, the state of every watch, and the alarms."""
    vary = ", ".join(baseline.varying) or "nothing"
    yield f"reference: {baseline.duration:.4g} s of the healthy machine; may vary without being wear: {vary}"
    yield f"promised: one false alarm in {baseline.false_alarm_hours:.4g} h of running as in the reference"
    yield ""
    yield Table.by_column(_STATES, zip(states, strict=True))
    rows = alarm_rows(baseline, records, traces)
    if rows:
        yield ""
        yield Table.by_column(_ALARMS, zip(rows[:_MOST_ALARMS], strict=True))
        if len(rows) > _MOST_ALARMS:
            yield f"and {len(rows) - _MOST_ALARMS} more alarms"
    yield ""
    yield from map(_sentence, states)
    for normal in baseline.normal:
        if abs(normal.offset) > max(0.5 * normal.sensitivity * abs(normal.watch.growth), 1.96 * normal.offset_stderr):
            yield (
                f"{normal.watch.parameter}: the reference itself differs from the model by "
                f"{normal.offset / normal.sensitivity:.3g} "
                f"{normal.watch.unit}: fit the model to the healthy machine first"
            )


def _sentence(state: WatchState) -> str:
    if state.state == "alarm":
        return f"{state.parameter}: alarm, it has changed in the direction of wear"
    if state.state == "quiet":
        return f"{state.parameter}: no sign of a change of {state.watched:.3g} {state.unit}, which would show"
    return f"{state.parameter}: this data cannot tell; {state.why}"
