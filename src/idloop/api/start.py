"""From the files of a log to a fitted model in one step."""

from __future__ import annotations

import shutil
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from idloop import drawing
from idloop.api.data import read_bags
from idloop.api.first_fit import FirstFit, FirstModel, beside_weight, first_fit, left_out
from idloop.api.inspection import inspect_bag, without_modelled_faults
from idloop.api.log import Log, recognise
from idloop.api.next_commands import commands, diagnosing, held_out, with_purpose
from idloop.api.result import Progress, Result, ignore_progress, part
from idloop.errors import InputError
from idloop.output_files import probe_folder, write_text
from idloop.records import compare_inspections
from idloop.records.inspection.faults import jumps, loops, outside_force, readings
from idloop.records.inspection.faults.command_sign import BACKWARD_TRAVEL, is_forwards
from idloop.records.inspection.faults.excitation import SMALL
from idloop.records.inspection.faults.fault import LATE
from idloop.records.inspection.faults.late import VELOCITY as LATE_VELOCITY
from idloop.records.inspection.faults.loops import SET_POINT, unit_of_set_point
from idloop.records.inspection.grade import EVERYTHING, NOT_USABLE, what
from idloop.records.inspection.measured_input import KIND as MEASURED
from idloop.records.inspection.response import visible_response
from idloop.records.inspection.together import judged_together
from idloop.records.inspection.velocity_check import KIND as WRONG_VELOCITY
from idloop.records.recognition.guess import LOAD
from idloop.records.recognition.mapping_file import load_of, mapping_of, motion_of, text_of
from idloop.records.recognition.role_units import base_unit_of
from idloop.records.tables.importing import import_bag
from idloop.reporting.plots.recording import plot_recognition
from idloop.reporting.text.blocks import Block
from idloop.reporting.text.comparison import held_scale, lowest_fits, measures_of, referred_load, verdict
from idloop.reporting.text.inspection import between_lines, recording_lines
from idloop.spelling import listed

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from idloop.api.fit import Fit
    from idloop.physics import Model
    from idloop.records import Finding, Record
    from idloop.records.inspection.inspection import Inspection

__all__ = ["Log", "Start", "begin", "recognise", "start"]

MAPPING, MODEL, FITTED, PICTURE, BAGS = "mapping.yaml", "model.yaml", "fitted.yaml", "log.png", "bags"
REFINED = "refined"  # where the commands that follow write
_OF_MAPPING = ("mapping", "`rows:`")  # words of a cure that is a key of the mapping
_MOST_ROWS = 12  # records whose measures are printed
_TURNED = "turned_command"  # the fault whose cure is an option


@dataclass(frozen=True)
class Start(Result):
    """What was recognised, written and fitted.

    Attributes
    ----------
    folder : Path
        Holds mapping, model file, bags, fitted model and picture.
    log : Log
    bags : tuple of Path
    inspections : tuple of Inspection
    done : FirstFit
        The fit, or why there is none.
    between : tuple of Finding
        Faults between the records.
    """

    folder: Path
    log: Log
    bags: tuple[Path, ...]
    inspections: tuple[Inspection, ...]
    done: FirstFit
    between: tuple[Finding, ...] = ()

    @property
    def model(self) -> Model:
        """The model with rough values; fitted values are in `fit`."""
        return self.done.model

    @property
    def fit(self) -> Fit | None:
        """The fit; None where there is none, or where its values describe nothing."""
        return self.done.fit

    @property
    def fitted_file(self) -> Path | None:
        """File of the fitted model; None where there is none."""
        return None if self.fit is None else self.folder / FITTED

    @property
    def not_fitted(self) -> str:
        """Why there is no fit."""
        return self.done.why_not

    @property
    def verdict(self) -> str:
        """What recording and fit are worth together; empty without a fit."""
        fitted = [one for one in self.inspections if one.path in self.done.bags]
        return "" if self.fit is None else verdict(fitted, self.fit.rows)

    @property
    def set_point_unit(self) -> str:
        """Unit in which the command is a set-point that the motion follows, where the log says none; else empty."""
        return next(
            (unit for one in self.inspections for fault in one.faults if (unit := unit_of_set_point(fault))), ""
        )

    @property
    def records(self) -> list[Record]:
        """The records that were fitted, as the model reads them."""
        return read_bags(self.done.bags, self.model)

    @property
    def commands(self) -> list[str]:
        """What to run next; nothing where the recording itself must be made again."""
        used = self.done.bags or self.bags
        bags, model = list(map(str, used)), self.folder / (FITTED if self.fit is not None else MODEL)
        if self.fit is not None or self.done.incomplete:
            unseen = held_out([one for one in self.inspections if one.path in used])
            return diagnosing(model, used, unseen, self.folder / REFINED)
        if self.done.apart:
            # Faults between records show where they are inspected together.
            lines = [["inspect", *bags]] if self.between else []
            lines += [["fit", str(model), *map(str, group)] for group in self.done.apart]
        elif self.done.asked:
            lines = []
        else:
            lines = [["inspect", *bags]] if self.between else [["inspect", bag] for bag in bags]
            if self.done.possible:
                lines.append(["fit", str(model), *bags])
        return commands(lines)

    def blocks(self) -> Iterator[Block]:
        """Yield the guesses, the verdict on each record, the fit, and what to run next."""
        yield from self.log.blocks()
        yield ""
        yield from self.outcome()

    def outcome(self) -> Iterator[Block]:
        """Yield what came of the guesses: verdicts, fit, and what to run next."""
        said = [*self.said(), *self.done.notes]
        yield from [*said, ""] if said else []
        if self.fit is not None:
            yield self.fit.result.summary()
            yield from referred_load(self.fit.model)
            yield from held_scale(self.fit.model)
            yield ""
            rows, others = lowest_fits(self.fit.rows, _MOST_ROWS)
            yield from measures_of(rows)
            yield from filter(None, [others])
            yield f"verdict: {self.verdict}"
        else:
            yield f"not fitted: {self.not_fitted}"
        if self.done.reversed and (flag := self.log.turned_command):
            yield f"run again with {flag} and another --output"
        if self.set_point_unit and self.log.recognition.of("command") is not None:
            yield (
                f"run again with {self.log.command_in(self.set_point_unit)} and another --output for a model of the"
                " loop in the drive; if it is a force, a torque, a current or a voltage, give its unit"
            )
        yield from self._again()
        lost = any(BACKWARD_TRAVEL in fault.evidence for one in self.inspections for fault in one.faults)
        if lost and (flag := self.log.command_with_sign_of_error):
            yield f"where it had the sign of the control error, run again with {flag} and another --output"
        if lost and (flag := self.log.signed_command):
            yield f"where a column has the sign, such as that of a direction pin, run again with {flag}"
        yield ""
        if any(word in line for word in _OF_MAPPING for line in (*said, *self.log.doubts)):
            yield f"the mapping is {self.folder / MAPPING}: change it there, then {self._import_again()}"
        fitted = f" {FITTED} (with the fitted values)," if self.fit is not None else ""
        yield (
            f"written to {self.folder}/: {MAPPING} (what the columns are), {MODEL} (the model),{fitted} {BAGS} (the"
            f" records), {PICTURE} (a picture of the signals)"
        )
        if commands := self.commands:
            yield "next:"
            yield from with_purpose(commands)
        if self.fit is not None and len(self.bags) == 1:
            yield (
                "a further record, with another command, would show whether the model holds on data that no fit has"
                " seen: start both files together"
            )

    def _again(self) -> Iterator[str]:
        """Yield the options that mend what the inspection found."""
        every = [fault for one in self.inspections for fault in one.faults]
        faults = {fault.kind: fault for fault in every}
        options = []
        if {loops.COPY, WRONG_VELOCITY} <= faults.keys() and (flags := self.log.exchanged_command):
            yield f"where the names of command and velocity are exchanged, run again with {flags} and another --output"
        late = next((one.evidence[LATE] for one in faults.values() if LATE in one.evidence), 0.0)
        options += [f"--late {self.log.late + late:.4g}"] if late else []
        kinds = (jumps.SPLICED, readings.STUCK, outside_force.PUSH, outside_force.CHANGED)
        cut = [place for fault in every if fault.kind in kinds for place in fault.places]
        options += filter(None, [self.log.rows_without(cut)])
        if options:
            yield f"run again with {' '.join(options)} and another --output"

    def _names(self, lines: Sequence[str]) -> Iterator[str]:
        """Yield which column is meant, where lines name the command by its topic."""
        column = command.column if (command := self.log.recognition.of("command")) is not None else ""
        names = {axis.command_name for one in self.inspections for axis in one.axes if axis.command_name}
        for name in sorted(names):
            if column and any(name in line for line in lines):
                yield f"{name} is the command, {column!r} of the log"

    def _import_again(self) -> str:
        """The command that imports the first record by the mapping that was written, beside its bag."""
        name, (source, window) = next(iter(self.log.runs.items()))
        words = ["import", "--map", str(self.folder / MAPPING), *(["--part", name] if window else [])]
        (command,) = commands([[*words, str(source), str(self.folder / BAGS / f"{name}_changed")]])
        return f"{command}; so with every other record" if len(self.log.runs) > 1 else command

    def said(self) -> Iterator[str]:
        """Yield what the inspection found: grade and faults of the records, then the faults between them."""
        lines = [*recording_lines(self.inspections), *between_lines(self.between)]
        yield from self._names(lines)
        yield from lines

    def plot(self) -> Figure:
        """Draw the signals as they were recognised."""
        return plot_recognition(self.log.recognition)

    def to_dict(self) -> dict[str, Any]:
        """Return the document of schema ``idloop/start/1``."""
        found = self.log.recognition
        return {
            "schema": "idloop/start/1",
            "files": list(map(str, self.log.files)),
            "folder": str(self.folder),
            "notes": self.log.notes,
            "time": {**found.base.time.model_dump(exclude_none=True), "reason": found.base.reason},
            "signals": [
                {"role": one.role, "column": one.column, "unit": one.unit, "reason": one.reason, **one.options}
                for one in found.guesses
            ],
            "not_used": list(found.other),
            "empty": self.log.empty,
            "doubts": self.log.doubts,
            "bags": list(map(str, self.bags)),
            "model": str(self.folder / MODEL),
            "fitted": None if self.fitted_file is None else str(self.fitted_file),
            "inspections": [one.to_dict() for one in self.inspections],
            "between": [one.to_dict() for one in self.between],
            "fit": None if self.fit is None else self.fit.to_dict(),
            "not_fitted": self.not_fitted,
            "verdict": self.verdict,
            "turn": self.log.turned_command if self.done.reversed else "",
            "next": self.commands,
        }


def start(
    files: str | Path | Iterable[str | Path],
    output: str | Path | None = None,
    given: Mapping[str, str] | None = None,
    *,
    period: float | None = None,
    csv: Mapping[str, Any] | None = None,
    rows: Sequence[slice] = (),
    late: float = 0.0,
    joint: str = "axis",
    fitted: bool = True,
    progress: Progress = ignore_progress,
) -> Start:
    r"""Turn a log into bags and a model file, inspect them, and fit the model.

    Parameters
    ----------
    files : path or iterable of path
        Logs of any form that is known; several are records of one axis, or one record with a signal or more in each.
    output : path, optional
        Folder to write; must not exist. By default the name of the file without its suffix, or what the names of
        several have in common.
    given : mapping of str to str, optional
        What a column is, by role (``time``, ``command``, ``position``, ``velocity``, ``effort``, ``reference``, ...):
        ``COLUMN``, ``COLUMN=UNIT``, ``=UNIT``, a formula, or ``none``.
    period : float, optional
        Sampling period [s], where the log has no time.
    csv : mapping, optional
        ``delimiter``, ``decimal``, ``header``, ``skip_rows``, where they cannot be found.
    rows : sequence of slice
        Rows of a table, or messages of the motion in a bag, counted from 0, each piece a record of its own; by default
        all.
    late : float
        Time by which the command was recorded late [s].
    joint : str
        Name of the joint.
    fitted : bool
        Fit the model.
    progress : callable, optional
        Called with the share done in [0, 1] and a short text.

    Returns
    -------
    Start

    Raises
    ------
    InputError
        A file cannot be read, has no time, no command or no motion, or the folder is there.

    Examples
    --------
    >>> import tempfile, idloop
    >>> from pathlib import Path
    >>> folder = Path(tempfile.mkdtemp())
    >>> signal = idloop.excitation("multilevel", sample_time=0.01, duration=10.0)
    >>> record = idloop.simulate(idloop.load_model("axis"), signal)
    >>> rows = zip(record.time, record.input, record.output[:, 0])
    >>> text = "t [s],torque [Nm],angle [rad]\n" + "".join(f"{t:.3f},{u},{q}\n" for t, u, q in rows)
    >>> _ = (folder / "log.csv").write_text(text)
    >>> begun = idloop.start(folder / "log.csv", folder / "begun")
    >>> round(begun.fit.values["axis.inertia"], 2)
    0.01
    """
    log = recognise(files, given, period=period, csv=csv, rows=rows, late=late)
    return begin(log, output, csv=csv, joint=joint, fitted=fitted, progress=progress)


def begin(
    log: Log,
    output: str | Path | None = None,
    *,
    csv: Mapping[str, Any] | None = None,
    joint: str = "axis",
    fitted: bool = True,
    progress: Progress = ignore_progress,
) -> Start:
    """Write, inspect and fit what `recognise` has found; what is not finished leaves no folder behind.

    `output`, `csv`, `joint`, `fitted`, `progress`: as in `start`.
    Raises InputError: the folder is there, or what was recognised cannot be imported.
    """
    if not joint.strip():
        raise InputError("the joint has no name; give one, such as --joint motor")
    _check_finite(log)
    folder = free_folder(log, output)
    mapping = _mapping(log, joint, csv)
    folder.mkdir(parents=True)
    try:
        return _begin(log, folder, mapping, joint, fitted=fitted, progress=progress)
    except BaseException:
        # Also after Ctrl-C: half a folder would stand in the way of the next attempt.
        shutil.rmtree(folder, ignore_errors=True)
        raise


def free_folder(log: Log, output: str | Path | None = None) -> Path:
    """Return the folder that will be written. Raises InputError: it is there already, or cannot be written."""
    return probe_folder(Path(output) if output is not None else Path(log.name), "--output", new=True, parents=True)


def _check_finite(log: Log) -> None:
    """Refuse an infinite value of what would be imported, by its column in the file."""
    for found in log.recognitions:
        for name in {guess.column for guess in found.guesses} & set(found.table.columns):
            rows = np.flatnonzero(np.isinf(found.table.numbers(name)))
            if rows.size:
                raise InputError(
                    f"{found.table.path}: column {name!r} is infinite in row {rows[0]}; correct the cell, or leave it"
                    " empty where nothing was measured"
                )


def _mapping(log: Log, joint: str, csv: Mapping[str, Any] | None) -> Any:
    names = tuple(one.name for one in log.files) if log.joined else ()
    mapping = mapping_of(log.recognition, log.name, joint, files=names)
    if any(window for _, window in log.runs.values()):
        mapping["parts"] = {run: window for run, (_, window) in log.runs.items()}
    if log.late and "command" in mapping:
        command = mapping["command"]
        clock = command.get("time") or mapping.get("time") or {"stamps": "header"}
        command["time"] = {**clock, "offset": -log.late}
    if csv:
        mapping.setdefault("csv", {}).update(csv)
    return mapping


def _begin(log: Log, folder: Path, mapping: Any, joint: str, *, fitted: bool, progress: Progress) -> Start:
    """Write, inspect and fit into a folder that is there."""
    write_text(folder / MAPPING, text_of(mapping))
    drawing.save(plot_recognition(log.recognition), folder / PICTURE)
    bags = tuple(folder / BAGS / run for run in log.runs)
    for index, (bag, (source, _)) in enumerate(zip(bags, log.runs.values(), strict=True)):
        progress(0.1 + 0.2 * index / len(bags), f"importing {bag.name}")
        import_bag(source, bag, folder / MAPPING, part=bag.name if "parts" in mapping else None)
    inspections: tuple[Inspection, ...] = ()
    for bag in bags:
        progress(0.3 + 0.1 * len(inspections) / len(bags), f"inspecting {bag.name}")
        inspections += (inspect_bag(bag),)
    command = log.recognition.of("command")
    outputs = {one.role: base_unit_of(one) for one in motion_of(log.recognition)}
    driven = log.recognition.of(LOAD)
    late = any(fault.kind == LATE_VELOCITY for one in inspections for fault in one.faults)
    if late:
        # The position says the same, and a model without the filter would take the delay for something else.
        outputs.pop("velocity")
    shown = next((one for inspection in inspections for one in inspection.findings if one.kind == MEASURED), None)
    unit = base_unit_of(command) if command is not None else ""
    measured = (command is not None and command.measured) or shown is not None
    load = (load_of(joint), base_unit_of(driven)) if driven is not None else None
    kind = FirstModel(log.name, joint, unit, outputs, measured, load)
    plain = kind.model()
    inspections = judged_together([without_modelled_faults(plain, one) for one in inspections])
    between = tuple(compare_inspections(inspections))
    used, unexcited = _excited(inspections)
    excited = tuple(one.path for one in used)
    if command is None:
        done = FirstFit(kind.model(), why_not="no command", asked=False, possible=False)
    elif apart := _apart(excited, used, between):
        rough = kind.model()
        if apart.groups:
            rough = first_fit(kind, apart.groups[0], fitted=False, progress=progress).model
        done = FirstFit(rough, why_not=apart.why, asked=fitted, reversed=apart.turned, apart=apart.groups)
    else:
        refused = used[0].grade_reason if _is_useless(used) else ""
        done = first_fit(kind, excited, fitted=fitted, refused=refused, progress=part(progress, 0.4, 0.9))
        if kind.load is not None and fitted and not refused and _is_massless(done, kind.load[0]):
            done = _with_one_body(done, kind, excited, part(progress, 0.9, 1.0))
    done = beside_weight(done, progress=part(progress, 0.9, 1.0))
    if done.reversed:
        done = forwards_beside_position(done, used)
    if done.unmoved:
        done = more_than_one_axis(done, used, log.recognition.joints)
    done = with_causes(done, used, f"{joint}.velocity is late and left out of the model" if late else "")
    if unexcited:
        done = replace(done, notes=(unexcited, *done.notes))
    if shown is not None:
        done = replace(done, notes=(*done.notes, f"{what(shown)}: the model takes it so (`input: {{kind: measured}}`)"))
    write_text(folder / MODEL, done.model.to_yaml())
    if done.fit is not None:
        write_text(folder / FITTED, done.fit.model.to_yaml())
    return Start(folder, log, bags, inspections, done, between)


def _is_massless(done: FirstFit, load: str) -> bool:
    """Whether a fit of two bodies finds no inertia of the load that its error does not cover, or nothing at all."""
    inertia = f"{load}.inertia"
    return done.fit is None or inertia in done.fit.result.at_bound or not done.fit.intervals[inertia][0] > 0.0


def _with_one_body(done: FirstFit, kind: FirstModel, bags: Sequence[Path], progress: Progress) -> FirstFit:
    """The fit of one body where it describes what that of two does not: a stiff gear, or a load of little inertia."""
    alone = first_fit(replace(kind, load=None), bags, fitted=True, progress=progress)
    if alone.fit is None or kind.load is None:
        return done
    note = f"{kind.load[0]}.position shows no inertia of its own: it is left out, and the model has one body"
    return replace(alone, notes=(*alone.notes, note))


def forwards_beside_position(done: FirstFit, inspections: Sequence[Inspection]) -> FirstFit:
    """Take back that the motion follows minus the command, where it does so for want of a spring or a weight.

    Below its resonance a swinging axis goes the way of its force, and a free one the other way.

    `done`: reversed.
    """
    driven = [axis for one in inspections for axis in one.axes if axis.command_name]
    if not driven or not all(map(is_forwards, driven)):
        return done
    if done.fit is not None:
        return replace(done, reversed=False)
    why = (
        "inertia and viscous friction predict the motion only with the sign of the command turned, but beside a force"
        " that depends on the position the command accelerates it forwards, and gives it power: a spring or a weight is"
        " missing; let a diagnosis find it"
    )
    return replace(done, why_not=why, reversed=False, incomplete=True)


def more_than_one_axis(done: FirstFit, inspections: Sequence[Inspection], joints: Sequence[str]) -> FirstFit:
    """Say of a motion that a model of one axis does not predict whether it follows the command, and what may move it.

    `done`: refused, as the model predicts no better with the command.
    `joints`: joints of the log with a motion and a command each.
    """
    driven = [axis for one in inspections for axis in one.axes if axis.command_name]
    shown = [found for axis in driven if (found := visible_response(axis)) is not None]
    arm = "of an arm, gravity and the other joints move it as well: `idloop robot` identifies all joints together"
    if shown:
        best = max(shown, key=lambda one: one.certainty)
        why = (
            f"the measured motion follows the command, whose gain is {best.certainty:.2g} standard errors, but a model"
            " of one axis predicts it no better with the command than without: other forces are larger; if the axis"
            f" is a joint {arm}"
        )
        return replace(done, why_not=why, unmoved=False)
    if not joints:
        return done
    why = (
        "a model of one axis predicts the measured motion no better with the command than without. It is one of"
        f" {len(joints)} joints; if these are {arm}. Else another column may be the command: --command COLUMN"
    )
    return replace(done, why_not=why)


def with_causes(done: FirstFit, inspections: Sequence[Inspection], note: str) -> FirstFit:
    """Add what was left out; and where one body describes nothing, the faults that may be why."""
    notes = (*done.notes, note) if note else done.notes
    # What only lowers the accuracy is no cause of values that describe nothing.
    faults = [what(one) for some in inspections for one in some.faults if one.spoils]
    if not ((done.incomplete or done.unmoved) and faults):
        return replace(done, notes=notes)
    return replace(done, notes=notes, why_not=f"{done.why_not}; or what the inspection names is the cause: {faults[0]}")


def _excited(inspections: tuple[Inspection, ...]) -> tuple[tuple[Inspection, ...], str]:
    """Return the records whose motion a fit can use, all of them where there is none; and what is left out, and why."""
    small = {one.path: fault for one in inspections for fault in one.faults if fault.kind == SMALL}
    used = tuple(one for one in inspections if one.path not in small)
    if not small or not used:
        return inspections, ""
    return used, f"left out of the fit: {listed(path.name for path in small)}: {what(next(iter(small.values())))}"


def _is_useless(inspections: Sequence[Inspection]) -> bool:
    """Whether there is one record only, and that of no use for a fit; beside others it may serve."""
    return len(inspections) == 1 and inspections[0].grade == f"{NOT_USABLE} {EVERYTHING}"


@dataclass(frozen=True)
class _Apart:
    """Why records cannot be fitted together, and which of them can."""

    why: str
    groups: tuple[tuple[Path, ...], ...] = ()
    turned: bool = False  # whether the motion follows minus the command


def _apart(bags: Sequence[Path], inspections: Sequence[Inspection], between: Sequence[Finding]) -> _Apart | None:
    """Return why a fit of all records together would mean nothing; None where it may mean something."""
    # A record whose fault spoils every fit would spoil the others' as well; one of no use may serve beside others.
    # A set-point makes a motion that no force explains.
    spoiling = {
        one.path.name: [fault for fault in one.faults if EVERYTHING in fault.spoils or fault.kind == SET_POINT]
        for one in inspections
    }
    if names := [name for name, faults in spoiling.items() if faults]:
        faults = spoiling[names[0]]
        sound = tuple(bag for bag in bags if bag.name not in names)
        turned = any(fault.kind == _TURNED for fault in faults)
        # Of one drive the command is turned in all records or in none.
        axes = [axis for one in inspections for axis in one.axes if axis.command_name and one.path.name not in names]
        if turned and any(map(is_forwards, axes)):
            turned = False
        elif turned:
            sound = ()
        return _Apart(f"{names[0]}: {what(faults[0])}{left_out(bags, sound)}", (sound,) if sound else (), turned)
    apart = [one for one in between if one.spoils]
    if apart:
        odd = {one.where for one in apart}
        alike = tuple(bag for bag in bags if bag.name not in odd)
        groups = (*((alike,) if alike else ()), *((bag,) for bag in bags if bag.name in odd))
        return _Apart(
            f"the records do not belong together: {what(apart[0])}; the commands below fit them apart", groups
        )
    return None
