"""The page on which a log is dropped: what it asks for, by the public API."""

from __future__ import annotations

import base64
import io
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from idloop.errors import InputError

if TYPE_CHECKING:
    from idloop.api.start import Log, Start

RATE = "rate"


def document_of(files: list[Path], given: Mapping[str, str]) -> dict[str, Any]:
    """What the page shows of some files: each signal with its column, unit and reason; what is missing in one line."""
    from idloop.records.recognition.recognise import ROLES

    try:
        log = _recognise(files, given)
    except InputError as error:
        columns = _columns(files)
        if not columns:
            raise
        signals = [_signal(role, given.get(role, ""), columns) for role in ("time", *ROLES)]
        return {"signals": signals, "columns": columns, "doubts": [], "notes": [], "picture": "", "missing": str(error)}
    found = log.recognition
    by_role = {one.role: one for one in found.guesses}
    time = found.base.time
    unit, reason = (time.unit, found.base.reason) if time.period is None else ("", f"a row every {time.period:g} s")
    signals = [{"role": "time", "column": str(time.column or ""), "unit": unit, "reason": reason}]
    for role in ROLES:
        one = by_role.get(role)
        signals.append(
            {"role": role, "column": one.column, "unit": one.unit, "reason": one.reason}
            if one is not None
            else {"role": role, "column": "", "unit": "", "reason": ""}
        )
    return {
        "signals": signals,
        "columns": list(found.table.columns),
        # The options of the command line are of no use on the page.
        "doubts": [doubt.partition(": --")[0] for doubt in found.all_doubts()],
        "notes": list(found.table.notes),
        "picture": _picture(log),
        "missing": "",
    }


def start_of(files: list[Path], given: Mapping[str, str], output: Callable[[str], Path]) -> Start:
    """Write, inspect and fit; InputError where there is no fit."""
    from idloop.api.start import begin

    log = _recognise(files, given)
    begun = begin(log, output(log.name))
    if begun.fit is None:
        raise InputError(f"written to {begun.folder}, but not fitted: {begun.not_fitted}")
    return begun


def serve(port: int, tell: Callable[[str], None]) -> None:
    """Serve the page until the process is ended, and a workbench for each log that was fitted.

    Parameters
    ----------
    port : int
        0 takes any that is free.
    tell : callable
        Called with the address.
    """
    from idloop.ending_signals import event_on_ending_signal
    from idloop.reporting.start_page.start_site import StartSite, Steps
    from idloop.reporting.workbench.offline import OfflineSource
    from idloop.reporting.workbench.server import Place, Site
    from idloop.reporting.workbench.steps import Study

    opened: list[tuple[Site, OfflineSource]] = []

    def begin(files: list[Path], given: Mapping[str, str]) -> str:
        begun = start_of(files, given, _free_folder)
        assert begun.fit is not None  # noqa: S101  (else there is an error)
        source = OfflineSource(begun.fit.model, Study(tuple(begun.records)), paths=(begun.bags, ()))
        site = Site(source, Place())
        opened.append((site, source))
        return site.address

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
    from idloop.api.start import recognise
    from idloop.records.tables.csv_layout import is_number

    rate = given.get(RATE, "")
    if rate and not (is_number(rate) and float(rate) > 0.0):
        raise InputError(f"{rate!r} rows per second are none; give a number above zero")
    said = {role: text for role, text in given.items() if role != RATE}
    return recognise(files, said, period=1.0 / float(rate) if rate else None)


def _columns(files: list[Path]) -> list[str]:
    from idloop.records.tables.table_files import read_table

    return [name for path in files for name in read_table(path, options={"skip_text": True}).columns]


def _signal(role: str, said: str, columns: list[str]) -> dict[str, str]:
    from idloop.records.recognition.guess import Given

    one = Given.parse(said, columns)
    return {"role": role, "column": one.column, "unit": one.unit, "reason": "as given" if said else ""}


def _picture(log: Log) -> str:
    """The signals as a picture that a page can show."""
    from idloop.reporting.plots.recognition import plot_recognition

    file = io.BytesIO()
    plot_recognition(log.recognition).savefig(file, format="png", dpi=110)
    return "data:image/png;base64," + base64.b64encode(file.getvalue()).decode()
