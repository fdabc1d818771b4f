"""Stamps that are not the times of the samples: of reception, of another clock, or of two publishers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from idloop.records.finding import Finding
from idloop.records.inspection.axis import Axis
from idloop.records.inspection.clocks import clock_finding
from idloop.records.inspection.faults.fault import LATE, fault, late_option
from idloop.records.inspection.response import regress
from idloop.records.inspection.time_axes import TimeAxes, time_axes
from idloop.spelling import joined_names

OFFSET = "clock_offset"

_BY = {
    "clocks": "two clocks {:.3g} s apart",
    "fields": "two sets of joints or fields",
    "stamps": "two grids of stamps",
}
# Scatter of the stamps that is worth a look, and intervals that count as lost samples, in periods.
_JITTER, _LOST = 0.03, 1.6
# Share of the bends of uneven stamps that the motion shows: 1 for times of samples, 0 for others. Standard errors, the
# largest of them, and samples on each side that give the speed.
_SHOWS, _ERRORS, _CERTAIN, _BESIDE = 0.5, 5.0, 0.1, 4
_ODD = 0.01  # share of the largest bends, at jumps and wraps
_FEWEST = 100
# Share of the acceleration that is explained with other times of the command, and of the rest that they leave.
_EXPLAINED, _LEFT = 0.6, 0.5
# Samples, and seconds, of a difference of two times that counts; a measured command is smoothed, and so late by itself.
_SAMPLES, _EARLY, _EARLY_ALONE = 3.0, 0.005, 0.02


def two_publishers(axis: Axis) -> list[Finding]:
    """Name the topics of the joint that hold two sequences of messages, interleaved and contradicting each other."""
    found = []
    for one in axis.publishers:
        many, few = one.counts
        by = _BY[one.evidence].format(abs(one.clock_offset))
        differ = f", and {joined_names(one.contradicting)} of both differ" if one.contradicting else ""
        found.append(
            fault(
                "two_publishers",
                one.topic,
                f"{one.topic}: two publishers, {many} and {few} messages with {by}{differ}",
                "stop one of the two nodes (`ros2 topic info --verbose`) and record again",
                evidence={"first": many, "second": few, "clock_offset": one.clock_offset},
                spoils=("identification",),
                count=few,
            )
        )
    return found


def of_reception(axis: Axis) -> Finding | None:
    """Stamps that are times of reception: the motion is smoother over the number of the sample than over them.

    A sampler takes its samples at even times; the network, the operating system or the recorder delays the messages,
    and each by another time. At constant speed a sample that was taken late lies further on:
    ``x[k+1] - 2 x[k] + x[k-1] = v (step after - step before)``.
    """
    field, value = next(iter(axis.signals.items()), ("", np.zeros(0)))
    known = np.isfinite(value)
    time, value = axis.time[: known.size][known], value[known]
    if time.size < _FEWEST:
        return None
    near = slice(_BESIDE - 1, 1 - _BESIDE)
    before, after = np.diff(time)[:-1][near], np.diff(time)[1:][near]
    period = axis.period
    whole = (np.maximum(before, after) < _LOST * period) & (np.minimum(before, after) > 0.0)
    # Independent errors of three stamps make the difference of two intervals.
    jitter = float(np.sqrt(np.mean(((before - after)[whole] / period) ** 2) / 6.0)) if whole.any() else 0.0
    if whole.sum() < _FEWEST or jitter < _JITTER:
        return None
    bend = np.diff(value, 2)[near]
    speed = (value[2 * _BESIDE :] - value[: -2 * _BESIDE]) / (2.0 * _BESIDE * period)
    whole &= np.abs(bend) <= np.quantile(np.abs(bend[whole]), 1.0 - _ODD)
    asked = (speed * (after - before))[whole]
    if not np.any(asked):
        return None
    (shown,), (error,), _ = regress(bend[whole], asked[:, None])
    if error > _CERTAIN or shown + _ERRORS * error > _SHOWS:
        return None
    scatter, name = jitter * period, axis.name(field)
    return fault(
        "wrong_stamps",
        name,
        f"the stamps of {name} scatter by {1e3 * scatter:.3g} ms around the {1e3 * period:.4g} ms period, but its"
        f" motion does not ({shown:.2f} ± {error:.1g} of the scatter shows in it): they are times of reception, not of"
        " the samples",
        "stamp where the sensor is read, or import with even stamps (`time: {period: ...}` in the mapping)",
        evidence={"jitter": scatter, "shown": shown, "error": error},
        spoils=("delays",),
    )


def two_clocks(axis: Axis) -> Finding | None:
    """Command and measurement stamped by two clocks, or one of them by simulated time.

    Stamps of two streams are compared at equal times of receipt, and by the motion: it never precedes the command, and
    follows it as late at the end of a record as at its beginning.
    """
    if axis.command_stream is None or axis.measured_stream is None:
        return None
    found = clock_finding(axis.command_stream, axis.measured_stream)
    if found is not None:
        return found
    # Both may have been stamped together, row by row, in one file.
    few, many = sorted((axis.input_time, axis.time), key=len)
    return None if not axis.joined and np.isin(few, many).all() else _by_motion(axis)


def _by_motion(axis: Axis) -> Finding | None:
    found, name = time_axes(axis), axis.command_name
    if found is None or found.share < _EXPLAINED:
        return None
    drift = abs(found.stretch - 1.0) * found.duration
    if drift > _SAMPLES * axis.period and 1.0 - found.share < _LEFT * (1.0 - found.without_stretch):
        percent = 1e2 * (1.0 / found.stretch - 1.0)
        faster = f"{abs(percent):.2g} % {'fast' if percent > 0.0 else 'slow'}"
        apart = (
            f"drift apart by {1e3 * drift:.3g} ms over {found.duration:.3g} s, the clock of the command runs {faster}"
        )
        return _fault(axis, found, f"two clocks: the times of {name} and of the motion {apart}")
    shifted = replace(found, stretch=1.0)
    least = max(_SAMPLES * axis.period, _EARLY if axis.joined else _EARLY_ALONE)
    if -found.offset > least and 1.0 - found.share < _LEFT * (1.0 - found.causal):
        return _fault(axis, shifted, f"two clocks: the motion precedes {name} by {-1e3 * found.offset:.3g} ms")
    if axis.joined and found.offset > least:
        late = f"the motion follows {name} {1e3 * found.offset:.3g} ms late"
        why = "the times of the files do not begin together, or the drive has such a delay"
        return _fault(axis, shifted, f"{late}: {why}", certain=False)
    return None


def _fault(axis: Axis, found: TimeAxes, what: str, *, certain: bool = True) -> Finding:
    keys = [f"stretch: {found.stretch:.6g}"] if found.stretch != 1.0 else []
    keys += [f"offset: {found.offset:.5g}"] if abs(found.offset) > 0.5 * axis.period or not keys else []
    shifted = found.stretch == 1.0
    cure = f"correct the times of the command in the mapping: `time: {{..., {', '.join(keys)}}}`"
    cure += f", as {late_option(-found.offset)} does" if shifted else ""
    evidence = {"offset": found.offset, "stretch": found.stretch, "share": found.share, "causal": found.causal}
    # What may be a delay of the drive is no fault of the stamps.
    late = {LATE: -found.offset} if shifted and certain else {}
    return fault(
        "two_clocks" if certain else OFFSET,
        axis.command_name,
        f"{what}; with times corrected for that, {100 * found.share:.0f} % of the acceleration follow the command, as"
        f" they are {100 * max(found.causal, 0.0):.0f} %",
        f"record both with one clock, or {cure}",
        evidence=evidence | late,
        spoils=("identification",) if certain else ("delays",),
    )
