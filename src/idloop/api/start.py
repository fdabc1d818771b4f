"""From the files of a log to a fitted model in one step."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from idloop.api.result import Progress, Result, ignore_progress, part
from idloop.errors import InputError
from idloop.reporting.text.blocks import Block, Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from idloop.api.fit import Fit
    from idloop.physics import Model
    from idloop.records import Record
    from idloop.records.inspection.inspection import Inspection
    from idloop.records.recognition.guess import Given
    from idloop.records.recognition.recognise import Recognition

MAPPING, MODEL, FITTED, PICTURE, BAGS = "mapping.yaml", "model.yaml", "fitted.yaml", "log.png", "bags"


@dataclass(frozen=True)
class Log:
    """Files as they were recognised.

    Attributes
    ----------
    files : tuple of Path
    recognitions : tuple of Recognition
        Of each file, or of all joined.
    joined : bool
        Whether the files are one record with a signal or more in each.
    """

    files: tuple[Path, ...]
    recognitions: tuple[Recognition, ...]
    joined: bool = False

    @property
    def recognition(self) -> Recognition:
        """What the first file holds; the others have the same columns."""
        return self.recognitions[0]

    @property
    def name(self) -> str:
        """Name of the first file, as the folder that is written by default."""
        return _plain_name(self.files[0])

    @property
    def runs(self) -> dict[str, tuple[Path, dict[str, Any]]]:
        """Source of each record by its name, and what it is of the source, as a part of a mapping."""
        found = {}
        sources = (_folder_of(self),) if self.joined else self.files
        for source, one in zip(sources, self.recognitions, strict=True):
            name = _plain_name(source)
            for piece, window in one.runs.items():
                found[f"{name}_{_plain(piece)}" if piece else name] = source, window
        if len(found) < sum(len(one.runs) for one in self.recognitions):
            raise InputError("two files have the same name; rename one, so that their bags can have theirs")
        return found

    def blocks(self) -> Iterator[Block]:
        """Yield a table of what each column is taken for, and what is uncertain."""
        found = self.recognition
        for note in found.table.notes:
            yield f"{found.table.path.name}: {note}"
        rows = [("time", str(found.base.time.column or "-"), _time_unit(found), found.base.reason)]
        rows += [(one.role, one.column or _constant(one.options), one.unit or "?", one.reason) for one in found.guesses]
        yield Table.of(("signal", "column", "unit", "why"), rows)
        if found.other:
            from idloop.spelling import listed

            yield f"not used: {listed(found.other, 12)}"
        for doubt in found.all_doubts():
            yield f"check: {doubt}"


@dataclass(frozen=True)
class Start(Result):
    """What was recognised, written and fitted.

    Attributes
    ----------
    folder : Path
        Holds mapping, model file, bags, fitted model and picture.
    log : Log
    bags : tuple of Path
    model : Model
        With rough values; fitted values are in `fit`.
    inspections : tuple of Inspection
    fit : Fit or None
    not_fitted : str
        Why there is no fit.
    """

    folder: Path
    log: Log
    bags: tuple[Path, ...]
    model: Model
    inspections: tuple[Inspection, ...]
    fit: Fit | None
    not_fitted: str = ""

    @property
    def records(self) -> list[Record]:
        """The records of the bags, as the model reads them."""
        from idloop.api.data import read_bags

        return read_bags(self.bags, self.model)

    @property
    def commands(self) -> list[str]:
        """What to run next."""
        bags = " ".join(map(str, self.bags))
        if self.fit is None:
            return [f"idloop inspect {self.bags[0]}", f"idloop fit {self.folder / MODEL} {bags}"]
        return [
            f"idloop diagnose {self.folder / FITTED} {bags}",
            f"idloop refine {self.folder / FITTED} {bags} --output {self.folder / 'refined'}",
        ]

    def blocks(self) -> Iterator[Block]:
        """Yield the guesses, the verdict on each record, the fit, and what to run next."""
        yield from self.log.blocks()
        yield ""
        yield from self.outcome()

    def outcome(self) -> Iterator[Block]:
        """Yield what came of the guesses: verdicts, fit, and what to run next."""
        for inspection in self.inspections:
            reason = "" if inspection.faults else f": {inspection.grade_reason}"
            yield f"{inspection.path.name}: {inspection.grade}{reason}"
            yield from (f"{one.level}: {one.text}" for one in inspection.faults)
        yield ""
        if self.fit is not None:
            yield from self.fit.blocks()
        else:
            yield f"not fitted: {self.not_fitted}"
        yield ""
        yield f"written: {self.folder}/ ({MAPPING}, {MODEL}, {BAGS}, {PICTURE}{', ' + FITTED if self.fit else ''})"
        yield "next:"
        yield from (f"  {command}" for command in self.commands)

    def plot(self) -> Figure:
        """Draw the signals as they were recognised."""
        from idloop.reporting.plots.recognition import plot_recognition

        return plot_recognition(self.log.recognition)

    def to_dict(self) -> dict[str, Any]:
        """Return the document of schema ``idloop/start/1``."""
        found = self.log.recognition
        return {
            "schema": "idloop/start/1",
            "files": list(map(str, self.log.files)),
            "folder": str(self.folder),
            "time": {**found.base.time.model_dump(exclude_none=True), "reason": found.base.reason},
            "signals": [
                {"role": one.role, "column": one.column, "unit": one.unit, "reason": one.reason, **one.options}
                for one in found.guesses
            ],
            "not_used": list(found.other),
            "doubts": found.all_doubts(),
            "bags": list(map(str, self.bags)),
            "model": str(self.folder / MODEL),
            "fitted": str(self.folder / FITTED) if self.fit is not None else None,
            "inspections": [one.to_dict() for one in self.inspections],
            "fit": self.fit.to_dict() if self.fit is not None else None,
            "not_fitted": self.not_fitted,
            "next": self.commands,
        }


def recognise(
    files: str | Path | Iterable[str | Path],
    given: Mapping[str, str] | None = None,
    *,
    period: float | None = None,
    csv: Mapping[str, Any] | None = None,
) -> Log:
    """Find out what the columns of a log are, without writing anything.

    Parameters
    ----------
    files, given, period, csv
        As in `start`.

    Returns
    -------
    Log

    Raises
    ------
    InputError
        A file cannot be read, or has no time, no command or no motion.
    """
    from idloop.records.bags.storage.storage_files import is_bag
    from idloop.records.recognition.recognise import recognise_table
    from idloop.records.tables.table_files import read_table

    paths = tuple(Path(one) for one in ([files] if isinstance(files, str | Path) else files))
    if not paths:
        raise InputError("name at least one file")
    if any(is_bag(path) for path in paths):
        return _of_bags(paths, given or {})
    options = {"skip_text": True, **(csv or {})}
    tables = [read_table(path, options=options) for path in paths]
    said = _given(given or {}, [name for table in tables for name in table.columns])
    if any(set(one.columns) != set(tables[0].columns) for one in tables):
        return Log(paths, (_joined(tables, said, period),), joined=True)
    return Log(paths, tuple(recognise_table(table, said, period=period) for table in tables))


def start(
    files: str | Path | Iterable[str | Path],
    output: str | Path | None = None,
    given: Mapping[str, str] | None = None,
    *,
    period: float | None = None,
    csv: Mapping[str, Any] | None = None,
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
        Folder to write; must not exist. By default the name of the first file without its suffix.
    given : mapping of str to str, optional
        What a column is, by role (``time``, ``command``, ``position``, ``velocity``, ``effort``, ``reference``, ...):
        ``COLUMN``, ``COLUMN=UNIT``, ``=UNIT``, a formula, or ``none``.
    period : float, optional
        Sampling period [s], where the log has no time.
    csv : mapping, optional
        ``delimiter``, ``decimal``, ``header``, ``skip_rows``, where they cannot be found.
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
    log = recognise(files, given, period=period, csv=csv)
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
    """Write, inspect and fit what `recognise` has found.

    Parameters
    ----------
    log : Log
    output, csv, joint, fitted, progress
        As in `start`.

    Returns
    -------
    Start

    Raises
    ------
    InputError
        The folder is there, or what was recognised cannot be imported.
    """
    from idloop import drawing
    from idloop.output_files import probe_folder, write_text
    from idloop.records import inspect_bag
    from idloop.records.inspection.grade import EVERYTHING, NOT_USABLE
    from idloop.records.inspection.measured_input import KIND as MEASURED
    from idloop.records.recognition.mapping_file import mapping_of, motion_of, text_of
    from idloop.records.recognition.model_start import start_model
    from idloop.records.recognition.recognise import base_unit_of
    from idloop.records.tables.importing import import_bag
    from idloop.reporting.plots.recognition import plot_recognition

    name = log.name
    folder = probe_folder(Path(output) if output is not None else Path(name), "--output", new=True, parents=True)
    names = tuple(str(one.relative_to(_folder_of(log))) for one in log.files) if log.joined else ()
    mapping = mapping_of(log.recognition, name, joint, files=names)
    if cut := any(window for _, window in log.runs.values()):
        mapping["parts"] = {run: window for run, (_, window) in log.runs.items()}
    if csv:
        mapping.setdefault("csv", {}).update(csv)
    folder.mkdir(parents=True)
    write_text(folder / MAPPING, text_of(mapping))
    drawing.save(plot_recognition(log.recognition), folder / PICTURE)
    progress(0.1, "importing")
    bags = tuple(folder / BAGS / run for run in log.runs)
    for bag, (source, _) in zip(bags, log.runs.values(), strict=True):
        import_bag(source, bag, folder / MAPPING, part=bag.name if cut else None)
    progress(0.3, "inspecting")
    inspections = tuple(inspect_bag(bag) for bag in bags)
    measured = any(one.kind == MEASURED for inspection in inspections for one in inspection.findings)
    command = log.recognition.of("command")
    unit = base_unit_of(command) if command is not None else ""
    outputs = {one.role: base_unit_of(one) for one in motion_of(log.recognition)}
    model = start_model(name, joint, unit, outputs)
    found, why = None, "no command"
    # A record whose fault spoils every fit would spoil the others' as well.
    spoilt = next((one for one in inspections if one.grade == f"{NOT_USABLE} {EVERYTHING}" and one.faults), None)
    if spoilt is not None:
        why = f"{spoilt.path.name} is {spoilt.grade}: {spoilt.grade_reason}"
    elif command is not None:
        model, found, why = _fit((name, joint, unit, outputs, measured), bags, fitted, part(progress, 0.4, 1.0))
    write_text(folder / MODEL, model.to_yaml())
    if found is not None:
        write_text(folder / FITTED, found.model.to_yaml())
    return Start(folder, log, bags, model, inspections, found, why)


def _fit(
    kind: tuple[str, str, str, dict[str, str], bool], bags: tuple[Path, ...], fitted: bool, progress: Progress
) -> tuple[Model, Fit | None, str]:
    """Return the model with rough values, its fit, and why there is none."""
    from idloop.api.data import read_bags
    from idloop.api.fit import fit
    from idloop.records.recognition.model_start import start_model

    *names, measured = kind
    model = start_model(*names, measured=measured)  # type: ignore[arg-type]
    try:
        records = read_bags(bags, model, fitted=False)
        model = start_model(*names, measured=measured, records=records)  # type: ignore[arg-type]
        if not fitted:
            return model, None, "not asked for"
        return model, fit(model, read_bags(bags, model), progress=progress), ""
    except InputError as error:
        return model, None, str(error)


def _joined(tables: list[Any], said: dict[str, Given], period: float | None) -> Recognition:
    """Recognise several files as one record."""
    from idloop.records.recognition.recognise import numbers_of, recognise_table
    from idloop.records.recognition.time_base import find_time_base
    from idloop.records.tables.joined import joined_tables

    folders = {table.path.parent.resolve() for table in tables}
    if len(folders) > 1:
        raise InputError(
            "the files have different columns and lie in different folders; put what belongs together into one"
        )
    for table in tables:
        numbers = numbers_of(table)
        count = max((value.size for value in numbers.values()), default=0)
        base = find_time_base(table, numbers, None, count, period)
        if base.time.column is not None and not table.clocks:
            clock = str(base.time.column)
            table.units[clock] = base.time.unit
            table.clocks = {name: clock for name in table.columns if name != clock}
    return recognise_table(joined_tables(tables[0].path.parent, tables), said)


def _of_bags(paths: tuple[Path, ...], given: Mapping[str, str]) -> Log:
    """Recognise the topics of bags, each a record."""
    from idloop.records.recognition.bag_table import bag_table
    from idloop.records.recognition.recognise import recognise_table

    found = []
    for path in paths:
        read = bag_table(path)
        said = _given(given, list(read.table.columns))
        one = recognise_table(read.table, said, sources=read.sources, joints=read.joints)
        one = replace(one, definitions=read.definitions)
        found.append(_by_receipt(one) if read.received else one)
    return Log(paths, tuple(found))


def _by_receipt(found: Recognition) -> Recognition:
    """Take the times of receipt as stamps, and say so."""
    from idloop.records.tables.mapping import Time

    reason = "the stamps of the topics have no clock in common: the times of receipt are taken"
    doubt = f"{reason}; set `use_sim_time` alike for all nodes before the next recording"
    return replace(found, base=replace(found.base, time=Time(stamps="receive"), reason=reason, doubt=doubt))


def _given(given: Mapping[str, str], columns: list[str]) -> dict[str, Given]:
    from idloop.records.recognition.guess import Given
    from idloop.records.recognition.recognise import ROLES

    unknown = next((role for role in given if role not in ("time", *ROLES)), None)
    if unknown is not None:
        raise InputError(f"no signal {unknown!r}; known are time, {', '.join(ROLES)}")
    return {role: Given.parse(text, columns) for role, text in given.items()}


def _folder_of(log: Log) -> Path:
    return Path(os.path.commonpath([path.parent for path in log.files]))


def _plain_name(path: Path) -> str:
    """Name of a file without its suffix, of characters that every file system and ROS takes."""
    from idloop.records.bags.storage.storage_files import bag_name, is_bag

    return _plain(bag_name(path) if is_bag(path) else path.stem or path.name) or "log"


def _plain(text: str) -> str:
    return "".join(letter if letter.isalnum() or letter in "-_." else "_" for letter in text).strip(".")


def _time_unit(found: Recognition) -> str:
    time = found.base.time
    return f"every {time.period:g} s" if time.period is not None else time.unit


def _constant(options: Mapping[str, Any]) -> str:
    return f"{options['value']:g}" if "value" in options else "name of the file"
