"""Records of one axis, judged together: whether they are of one machine, and what they show beside each other."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from idloop.arrays import Array
from idloop.records.finding import Finding
from idloop.records.inspection.axis import Axis, Grid
from idloop.records.inspection.faults.excitation import SLOW, SMALL, STILL, TWO_LEVELS, is_slow
from idloop.records.inspection.faults.fault import fault
from idloop.records.inspection.faults.loops import set_point
from idloop.records.inspection.faults.readings import COARSE, is_coarse
from idloop.records.inspection.inspection import Inspection
from idloop.records.inspection.response import Response, beyond, response, unexplained

# A gain counts where it is that certain, and explains this share of the acceleration.
_CERTAIN, _SHARE = 8.0, 0.5
# Levels at which a force may bend, as quantiles of the sizes of the commands, and share of what a gain for each record
# leaves that such a force of all records must not exceed.
_LEVELS, _LEFT = (0.1, 0.25, 0.4, 0.55, 0.7, 0.85), 0.5
_RATE = 0.05
_SPOILS = ("a common fit",)


def compare_inspections(inspections: Iterable[Inspection]) -> list[Finding]:
    """Return the faults between recordings: other joints, units, sample times or gains."""
    found = list(inspections)
    unique = len({one.path.name for one in found}) == len(found)
    return between_records({one.path.name if unique else str(one.path): one.axes for one in found})


def between_records(records: Mapping[str, Sequence[Axis]]) -> list[Finding]:
    """Return the faults between records.

    `records`: the joints of each record, by the name of the record.
    """
    first, *names = records
    found = []
    for other in names:
        ours, theirs = ({axis.joint: axis for axis in records[name]} for name in (first, other))
        if ours and theirs and not set(ours) & set(theirs):
            joints = f"{other} has the joints {', '.join(sorted(theirs))}, {first} has {', '.join(sorted(ours))}"
            cure = "name the joints alike in the mapping, or fit the records apart"
            found.append(fault("other_joints", other, f"{joints}: not one machine", cure, spoils=_SPOILS))
        for joint in [name for name in ours if name in theirs]:
            found += _units_and_rates(first, other, ours[joint], theirs[joint])
    for joint in sorted({axis.joint for axes in records.values() for axis in axes}):
        same = {name: axis for name, axes in records.items() for axis in axes if axis.joint == joint}
        found += _gains(joint, same)
    return found


def _units_and_rates(first: str, other: str, one: Axis, two: Axis) -> list[Finding]:
    found = []
    for name in sorted(set(one.units) & set(two.units)):
        if name.rpartition(".")[0] == one.joint and one.units[name] != two.units[name]:
            what = f"{name} is in {two.units[name]} in {other} and in {one.units[name]} in {first}"
            found.append(fault("other_units", other, what, "give one unit in the mappings", spoils=_SPOILS))
    if abs(two.period / one.period - 1.0) > _RATE:
        what = f"{other} is sampled every {1e3 * two.period:.4g} ms, {first} every {1e3 * one.period:.4g} ms"
        cure = "a physical fit takes both; for black-box models bring them to one rate (`Record.resample`)"
        evidence = {"first": one.period, "other": two.period}
        found.append(fault("other_rate", other, what, cure, evidence=evidence, level="note"))
    return found


def _gains(joint: str, axes: Mapping[str, Axis]) -> list[Finding]:
    """Compare the gain of each record with that of the most: a Chow test of the gain, with jackknife errors.

    A set-point of a loop in the drive accelerates nothing by itself, so that it has no gain to compare.
    """
    shown = {name: response(axis, _SHARE) for name, axis in axes.items() if not set_point(axis)}
    known = {name: one for name, one in shown.items() if one is not None and abs(one.certainty) > _CERTAIN}
    if len(known) < 2:
        return []
    agree = {name: sum(not _differ(one, two) for two in known.values()) for name, one in known.items()}
    usual = max(known, key=lambda name: (agree[name], abs(known[name].certainty)))
    two, found = known[usual], []
    for name, one in known.items():
        if _differ(one, two) and not _bend_alike((axes[name], one), (axes[usual], two)):
            ratio = one.gain / two.gain
            what = (
                f"{joint}: the same command accelerates {ratio:.3g} times as much in {name} as in {usual}"
                f" ({one.gain:.3g} ± {one.error:.1g} and {two.gain:.3g} ± {two.error:.1g}): another load, gear or unit"
            )
            cure = "fit the records apart, or correct the units of one"
            errors = {"difference": abs(one.gain - two.gain), "error": float(np.hypot(one.error, two.error))}
            found.append(fault("other_gain", name, what, cure, evidence={"ratio": ratio, **errors}, spoils=_SPOILS))
    return found


def _differ(one: Response, two: Response) -> bool:
    return all(
        one.gain_of(beside_position=there).differs(two.gain_of(beside_position=there)) for there in (False, True)
    )


def _bend_alike(one: tuple[Axis, Response], two: tuple[Axis, Response]) -> bool:
    """Whether one bent force of the command explains what seem to be two gains: a dead zone, a limit of the drive.

    Commands of other sizes then have other gains on the same machine. Each record keeps its own friction and constant.
    """
    known = [(axis.grid, found) for axis, found in (one, two) if axis.grid is not None]
    sizes = np.concatenate([np.abs(grid.command) for grid, _ in known])
    levels = np.unique(np.nanquantile(sizes, _LEVELS))
    (first, first_forces, first_beside), (second, second_forces, second_beside) = (
        _bent_rows(grid, found, levels) for grid, found in known
    )
    target, bent = np.concatenate([first, second]), np.concatenate([first_forces, second_forces])
    beside = np.zeros((target.size, first_beside.shape[1] + second_beside.shape[1]))
    beside[: first.size, : first_beside.shape[1]] = first_beside
    beside[first.size :, first_beside.shape[1] :] = second_beside
    own = np.where(np.arange(target.size) < first.size, bent[:, 0], 0.0)
    apart = unexplained(target, np.column_stack([own, bent[:, 0], beside]))
    alike = unexplained(target, np.column_stack([bent, beside]))
    # Another gain of one record beside the bent force must not explain far more again.
    both = unexplained(target, np.column_stack([own, bent, beside]))
    return alike < _LEFT * apart and both > _LEFT * alike


def _bent_rows(grid: Grid, found: Response, levels: Array) -> tuple[Array, Array, Array]:
    """Acceleration, the command with its parts beyond each level, and the other terms of the rows of a record."""
    parts = [beyond(grid.command, level) for level in levels]
    target, table = found.with_terms(parts[0], parts[1:])
    last = 2 + found.others.shape[1]
    return target, np.column_stack([table[:, 1], table[:, 0], table[:, last:]]), table[:, 2:last]


def judged_together(inspections: Sequence[Inspection]) -> tuple[Inspection, ...]:
    """Return the inspections of one set, where faults of an excitation that the set has not are notes.

    The levels of a command add up, as the range of a coarse sensor does, and an inertia that a slow record does not
    show is known from one that does.
    """
    axes: dict[str, list[tuple[Axis, Inspection]]] = {}
    for one in inspections:
        for axis in one.axes:
            axes.setdefault(axis.joint, []).append((axis, one))
    return tuple(_judged(one, axes) for one in inspections) if len(inspections) > 1 else tuple(inspections)


def _judged(inspection: Inspection, axes: dict[str, list[tuple[Axis, Inspection]]]) -> Inspection:
    hidden = {
        one.kind
        for one in inspection.faults
        if not any(
            _is_shown(one, axes[axis.joint]) for axis in inspection.axes if one.where.startswith(f"{axis.joint}.")
        )
    }
    shown = {one.kind for one in inspection.faults} & {TWO_LEVELS, SLOW, COARSE} - hidden
    return inspection.with_notes(*shown) if shown else inspection


def _is_shown(fault: Finding, axes: Sequence[tuple[Axis, Inspection]]) -> bool:
    """Whether records of a joint together have not the fault that one of them has."""
    if fault.kind == TWO_LEVELS:
        return np.unique(np.concatenate([np.unique(axis.known_command)[:3] for axis, _ in axes])).size > 2
    if fault.kind == SLOW:
        return is_slow(fault) and any(_shows_inertia(axis, one) for axis, one in axes)
    values = [value for axis, _ in axes if (value := axis.motions.get(fault.where)) is not None]
    return fault.kind == COARSE and bool(values) and not is_coarse(fault, np.concatenate(values))


def _shows_inertia(axis: Axis, inspection: Inspection) -> bool:
    """Whether nothing was found that hides the inertia."""
    hidden = any(
        one.kind in (SLOW, SMALL, STILL) and one.where.partition(".")[0] == axis.joint for one in inspection.faults
    )
    return not hidden and response(axis) is not None
