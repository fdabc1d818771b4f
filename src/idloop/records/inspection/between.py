"""Records that do not belong together: other units, sample times, joints, or another gain."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from idloop.records.finding import Finding
from idloop.records.inspection.axis import Axis
from idloop.records.inspection.faults import inner_loop
from idloop.records.inspection.faults.fault import fault
from idloop.records.inspection.response import Response, response

# A gain counts where it is that certain, and explains this share of the acceleration.
_CERTAIN, _SHARE = 8.0, 0.5
_RATE = 0.05


def between_records(records: Mapping[str, Sequence[Axis]]) -> list[Finding]:
    """Return the faults between records.

    `records`: the joints of each record, by the name of the record.
    """
    names = list(records)
    first = names[0]
    found = []
    for other in names[1:]:
        ours, theirs = ({axis.joint: axis for axis in records[name]} for name in (first, other))
        if not set(ours) & set(theirs):
            if ours and theirs:
                found.append(_joints(first, other, sorted(ours), sorted(theirs)))
            continue
        for joint in [name for name in ours if name in theirs]:
            found += _units(first, other, ours[joint], theirs[joint])
            found += _rates(first, other, ours[joint], theirs[joint])
    joints = {axis.joint for axes in records.values() for axis in axes}
    for joint in sorted(joints):
        same = {name: axis for name, axes in records.items() for axis in axes if axis.joint == joint}
        found += _gains(joint, same)
    return found


def _joints(first: str, other: str, ours: list[str], theirs: list[str]) -> Finding:
    return fault(
        "other_joints",
        other,
        f"{other} has the joints {', '.join(theirs)}, {first} has {', '.join(ours)}: not one machine",
        "name the joints alike in the mapping, or fit the records apart",
        spoils=("a common fit",),
    )


def _units(first: str, other: str, one: Axis, two: Axis) -> list[Finding]:
    return [
        fault(
            "other_units",
            other,
            f"{name} is in {two.units[name]} in {other} and in {one.units[name]} in {first}",
            "give one unit in the mappings",
            spoils=("a common fit",),
        )
        for name in sorted(set(one.units) & set(two.units))
        if name.rpartition(".")[0] == one.joint and one.units[name] != two.units[name]
    ]


def _rates(first: str, other: str, one: Axis, two: Axis) -> list[Finding]:
    if not abs(two.period / one.period - 1.0) > _RATE:
        return []
    return [
        fault(
            "other_rate",
            other,
            f"{other} is sampled every {1e3 * two.period:.4g} ms, {first} every {1e3 * one.period:.4g} ms",
            "a physical fit takes both; for black-box models bring them to one rate (`Record.resample`)",
            evidence={"first": one.period, "other": two.period},
            level="note",
        )
    ]


def _gains(joint: str, axes: Mapping[str, Axis]) -> list[Finding]:
    """Compare the gain of each record with that of the most: a Chow test of the gain, with jackknife errors.

    A set-point of a loop in the drive accelerates nothing by itself, so that it has no gain to compare.
    """
    known = {
        name: found
        for name, axis in axes.items()
        if not inner_loop.check(axis)
        and (found := response(axis, _SHARE)) is not None
        and abs(found.certainty) > _CERTAIN
    }
    if len(known) < 2:
        return []
    agree = {name: sum(not _differ(one, two) for two in known.values()) for name, one in known.items()}
    usual = max(known, key=lambda name: (agree[name], abs(known[name].certainty)))
    two = known[usual]
    return [
        fault(
            "other_gain",
            name,
            f"{joint}: the same command accelerates {one.gain / two.gain:.3g} times as much in {name} as in {usual}"
            f" ({one.gain:.3g} ± {one.error:.1g} and {two.gain:.3g} ± {two.error:.1g}): another load, gear or unit",
            "fit the records apart, or correct the units of one",
            evidence={
                "ratio": one.gain / two.gain,
                "difference": abs(one.gain - two.gain),
                "error": float(np.hypot(one.error, two.error)),
            },
            spoils=("a common fit",),
        )
        for name, one in known.items()
        if _differ(one, two)
    ]


def _differ(one: Response, two: Response) -> bool:
    return all(
        one.gain_of(beside_position=there).differs(two.gain_of(beside_position=there)) for there in (False, True)
    )
