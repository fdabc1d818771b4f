"""The page on which a log is dropped: what it asks for, by the public API."""

from __future__ import annotations

import base64
import io
import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from idloop.cli import _outputs
from idloop.cli.verbs.start import RATE, period_of
from idloop.errors import InputError

if TYPE_CHECKING:
    from idloop.api.log import Log
    from idloop.api.start import Start
    from idloop.records.recognition.recognise import Recognition

# Said of the log beside its signals and `RATE`: files that no fit sees, a line each.
KEPT_UNSEEN = "unseen"
# The options of the command line are of no use on the page, which has a table instead: what a doubt ends with, and what
# answers a refusal.
_OPTION = re.compile(r"[:;,]? ?(?:if [^;:]*, )?(?<![\w-])--(?:'[^']*'|[^;])*")
_ANSWER = re.compile(r"[;,] [^;,]*--.*")


def document_of(files: list[Path], given: Mapping[str, str]) -> dict[str, Any]:
    """What the page shows of some files: each signal with its column, unit and reason; what is missing in one line."""
    from idloop.records.recognition.guess import ROLES

    try:
        log = _recognise(files, given)
    except InputError as error:
        columns = _columns(files)
        if not columns:
            raise
        signals = [_signal(role, given.get(role, ""), columns) for role in ("time", *ROLES)]
        empty: dict[str, Any] = {"turned": "", "doubts": [], "notes": [], "pictures": [], "folder": ""}
        return {"signals": signals, "columns": columns, **empty, "missing": _refusal(error, files)}
    found = log.recognition
    by_role = {one.role: one for one in found.guesses}
    time = found.base.time
    unit, reason = (time.unit, found.base.reason) if time.period is None else ("", f"a row every {time.period:g} s")
    signals = [{"role": "time", "column": str(time.source or ""), "unit": unit, "reason": reason}]
    for role in ROLES:
        one = by_role.get(role)
        signals.append({"role": role} | {key: getattr(one, key, "") for key in ("column", "unit", "reason")})
    return {
        "signals": signals,
        "columns": list(found.table.columns),
        "turned": log.turned_column,
        "doubts": [_OPTION.sub("", doubt) for doubt in log.doubts],
        "notes": [*log.notes, *log.unused],
        "pictures": _pictures(log, _unseen(files, given)),
        "folder": str(_free_folder(log.name).absolute()),
        "missing": "",
    }


def start_of(
    files: list[Path], given: Mapping[str, str], output: Callable[[str], Path]
) -> tuple[Start, tuple[Path, ...]]:
    """Write, inspect and fit, and write the bags of what no fit sees; a refusal is in the words of the page."""
    from idloop.api.start import begin

    kept = _unseen(files, given)
    if kept == set(files):
        raise InputError("every file is kept unseen: one at least must be fitted")
    try:
        log = _recognise(files, given)
        fitted, unseen = _parts(log, [one not in kept for one in files]), _parts(log, [one in kept for one in files])
        begun = begin(fitted or log, output(log.name))
        if unseen is None:
            return begun, ()
        return begun, begin(unseen, begun.folder / "unseen", fitted=False).bags
    except InputError as error:
        raise InputError(_refusal(error, files)) from None


def refused(begun: Start) -> str:
    """Why there is no fit, in the words of the page; empty where there is one."""
    if begun.fit is not None:
        return ""
    turned = begun.log.turned_column if begun.done.reversed else ""
    turn = f"; choose {turned} as the command" if turned else ""
    why = _OPTION.sub("", begun.not_fitted)
    if begun.done.apart:
        # The page has no commands below: they follow where the shell points to them.
        why = f"{why.replace(' below', ' here')}: {'; '.join(begun.commands)}; or keep all but one unseen"
    return f"written to {begun.folder.absolute()}, but not fitted: {why}{turn}"


def serve(port: int, tell: Callable[[str], None]) -> None:
    """Serve the page until the process is ended, and a workbench for each log that was fitted.

    `port`: 0 takes any that is free.
    `tell`: called with the address.
    """
    from idloop.api.data import read_bags
    from idloop.ending_signals import event_on_ending_signal
    from idloop.reporting.start_page.start_site import StartSite, Steps
    from idloop.reporting.workbench.offline import OfflineSource
    from idloop.reporting.workbench.server import Place, Site
    from idloop.reporting.workbench.steps import Study

    opened: list[tuple[Site, OfflineSource]] = []

    def begin(files: list[Path], given: Mapping[str, str]) -> dict[str, Any]:
        begun, unseen = start_of(files, given, _free_folder)
        _outputs.log(f"written: {begun.folder.absolute()}")
        inspected = [*begun.said(), *begun.done.notes]
        if begun.fit is None:
            return {"address": "", "inspected": inspected, "refused": refused(begun)}
        source = OfflineSource(
            begun.fit.model,
            Study(tuple(begun.records), tuple(read_bags(unseen, begun.fit.model, fitted=False)) if unseen else ()),
            paths=(begun.done.bags, unseen),
            model_file=begun.fitted_file,
            inspected=inspected,
        )
        site = Site(source, Place())
        opened.append((site, source))
        return {"address": site.address, "inspected": inspected, "refused": ""}

    page = StartSite(Steps(document_of, begin), port)
    try:
        tell(page.address)
        with event_on_ending_signal() as ended:
            ended.wait()
    finally:
        page.close()
        for site, source in opened:
            site.close()
            source.close()


def _free_folder(name: str) -> Path:
    """A folder of this name that is not there yet, numbered where it is."""
    folder, number = Path(name), 1
    while folder.exists():
        number += 1
        folder = Path(f"{name}-{number}")
    return folder


def _recognise(files: list[Path], given: Mapping[str, str]) -> Log:
    from idloop.api.log import recognise

    rate = given.get(RATE, "")
    said = {role: text for role, text in given.items() if role not in (RATE, KEPT_UNSEEN)}
    return recognise(files, said, period=period_of(rate) if rate else None)


def _unseen(files: list[Path], given: Mapping[str, str]) -> set[Path]:
    """Files that no fit is to see."""
    names = given.get(KEPT_UNSEEN, "").splitlines()
    return {path for path in files if path.name in names}


def _parts(log: Log, chosen: list[bool]) -> Log | None:
    """The log of some of its files; None of none. Files that are joined are one record, which is not parted."""
    if log.joined:
        return log if any(chosen) and chosen[0] else None
    files = tuple(path for path, yes in zip(log.files, chosen, strict=True) if yes)
    found = tuple(one for one, yes in zip(log.recognitions, chosen, strict=True) if yes)
    return replace(log, files=files, recognitions=found) if files else None


def _refusal(error: InputError, files: list[Path]) -> str:
    """What is wrong, with the cure of the page."""
    from idloop.reporting.start_page.start_site import plain_names

    text = plain_names(str(error), files)
    return _ANSWER.sub(": say it in the table, or give the rows per second", text).replace("--", "")


def _columns(files: list[Path]) -> list[str]:
    from idloop.records.tables.table_files import read_table

    return [name for path in files for name in read_table(path, options={"skip_text": True}).columns]


def _signal(role: str, said: str, columns: list[str]) -> dict[str, str]:
    from idloop.records.recognition.guess import Given

    one = Given.parse(said, columns)
    return {"role": role, "column": one.column, "unit": one.unit, "reason": "as given" if said else ""}


def _pictures(log: Log, unseen: set[Path]) -> list[dict[str, Any]]:
    """The signals of each file as a picture that a page can show, and whether a fit may be kept from seeing it."""
    several = len(log.recognitions) > 1
    # Of joined files the first stands for all.
    shown = zip(log.files, log.recognitions, strict=False)
    names = {path: log.name if log.joined else path.name for path in log.files}
    return [
        {"name": names[path], "choice": several, "unseen": path in unseen, "picture": _picture(one)}
        for path, one in shown
    ]


def _picture(found: Recognition) -> str:
    from idloop.reporting.plots.recording import plot_recognition

    file = io.BytesIO()
    plot_recognition(found).savefig(file, format="png", dpi=110)
    return "data:image/png;base64," + base64.b64encode(file.getvalue()).decode()
