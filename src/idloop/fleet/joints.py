"""A report of every joint: a file serves many joints, and the address names the one that is shown."""

from __future__ import annotations

import re
import shlex
import sys
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from idloop.called_as import program
from idloop.drawing import label
from idloop.fleet import words
from idloop.fleet.figures import Z95, label_of, trend
from idloop.fleet.statistics import Components, Series
from idloop.fleet.store import JOINTS, Recording
from idloop.fleet.words import display, failed_table, finding_table, kind_text, level_table
from idloop.reporting.page.sheet import json_text, render_sheet
from idloop.reporting.terms import capitalised
from idloop.reporting.text.blocks import Table, number

TEMPLATE = Path(__file__).parent / "templates" / "joints.html"
MOST_RECORDINGS = 20_000  # of joints in a file: some megabytes


@dataclass(frozen=True)
class JointFile:
    """Joints of a kind that share a file, by robot and name; its path begins at the folder of the results."""

    kind: str
    path: str
    names: tuple[tuple[str, str], ...]
    components: tuple[Components, ...]


def joint_files(components: Iterable[Components]) -> list[JointFile]:
    """Divide the joints of each kind into files."""
    kinds: dict[str, list[Components]] = {}
    for one in components:
        kinds.setdefault(one.series.kind, []).append(one)
    found, stems = [], file_stems(kinds)
    for kind, own in kinds.items():
        names = sorted({name for one in own for name in one.series.names})
        size = max(MOST_RECORDINGS // max(len(one.series.days) for one in own), 1)
        for part, first in enumerate(range(0, len(names), size), start=1):
            path = f"{JOINTS}/{stems[kind]}-{part}.html"
            found.append(JointFile(kind, path, tuple(names[first : first + size]), tuple(own)))
    return found


def file_stems(kinds: Collection[str]) -> dict[str, str]:
    """Name of a file for each kind, which may be a pattern."""
    stems: dict[str, str] = {}
    for kind in kinds:
        stem = re.sub(r"[^\w.-]+", "_", kind).strip("_") or "all"
        stems[kind] = f"{stem}-{len(stems) + 1}" if stem in stems.values() else stem
    return stems


def of_files(
    files: Iterable[JointFile], recordings: Iterable[Recording]
) -> Iterator[tuple[JointFile, list[Recording]]]:
    """Yield each file of a kind with the recordings of its joints, which come by robot and joint."""
    place = {name: file for file in files for name in file.names}
    for _, several in groupby(recordings, lambda one: place[one.robot, one.joint].path):
        own = list(several)
        yield place[own[0].robot, own[0].joint], own


def addresses(files: Iterable[JointFile]) -> dict[tuple[str, str], str]:
    """Address of the report of each joint."""
    return {name: f"{one.path}?{' '.join(name)}" for one in files for name in one.names}


def render_joints(
    file: JointFile, document: Mapping[str, Any], recordings: Iterable[Recording], model: str, joint: str
) -> str:
    """Write the page of some joints of a fleet and its document of schema ``idloop/fleet/1``.

    `recordings`: of these joints, each joint's in the order of time. `model`, `joint`: file of the model of the kind,
    and the name that it has for the joint.
    """
    from markupsafe import Markup

    badly = {name: error for one in file.components for name, error in words.misfits(one).items()}
    by_joint: dict[tuple[str, str], list[Recording]] = {name: [] for name in file.names}
    for one in recordings:
        by_joint[one.robot, one.joint].append(one)
    robots = {robot for robot, _ in file.names}
    kind = kind_text(file.kind, [one["kind"] for one in document["kinds"]])
    tables = {
        "findings": finding_table(document, "findings"), "alarms": finding_table(document, "alarms"),
        "diagnoses": _diagnosis_table(document), "levels": level_table(file.components),
        "recordings": _recording_table(by_joint, file.components), "failed": failed_table(document, merged=False),
    }  # fmt: skip
    joints = {
        " ".join(name): {
            "name": list(name), "headline": _headline(kind, several),
            "warning": f"Warning: {words.misfit_text(badly[name])}." if name in badly else "",
            "command": "\n".join(_commands(model, joint, several[-1])) if several else "",
            "curves": {f"trend-{place}": _curve(several, one.series) for place, one in enumerate(file.components)},
        }
        for name, several in by_joint.items()
    }  # fmt: skip
    rows = {key: [row for row in one.rows if row[0] in robots] for key, one in tables.items()}
    return render_sheet(
        TEMPLATE,
        {f"trend-{place}": trend(one, [], f"trend-{place}") for place, one in enumerate(file.components)},
        name=document["source"],
        headline=f"reports of {kind}",
        tables={key: Table(one.header, ()) for key, one in tables.items()},
        trends=[label_of(one)[0] for one in file.components],
        words=words,
        capitalised=capitalised,
        joints=Markup(json_text({"joints": joints, "rows": rows})),  # noqa: S704
    )


def _headline(kind: str, several: Sequence[Recording]) -> str:
    days = sorted({str(one.time)[:10] for one in several})
    return f"Compared with {kind}; {len(several)} recordings from {days[0]} to {days[-1]}" if several else ""


def _diagnosis_table(document: Mapping[str, Any]) -> Table:
    rows = [
        (one["robot"], one["joint"], one["conclusion"], PurePosixPath(one["report"] or "").name)
        for one in document["diagnoses"]
    ]
    return Table.of(("robot", "joint", "the catalogue of effects", "report"), rows)


def _recording_table(
    by_joint: Mapping[tuple[str, str], Sequence[Recording]], components: Sequence[Components]
) -> Table:
    """The newest recordings first."""
    heads = [label(*label_of(one)) for one in components]
    parameters = [one.series.parameter for one in components]
    return Table.of(
        (
            "robot", "joint", "date", *heads, "force error of the fit [% of drive force]",
            "force residual (rms)", "duration [s]", "bag", "notes",
        ),
        (
            (
                one.robot, one.joint, str(one.time)[:10], *(_estimate(one, name) for name in parameters),
                number(100.0 * (one.error_fitted or np.nan), 3), f"{number(one.force_residual, 3)} {one.force_unit}",
                number(one.seconds, 3), one.bag, one.notes or "",
            )
            for several in by_joint.values() for one in reversed(several)
        ),
    )  # fmt: skip


def _estimate(one: Recording, parameter: str) -> str:
    value, stderr = one.estimates.get(parameter, (None, None))
    if value is None:
        return "-"
    factor, _ = display(parameter, "")
    shown = number(factor * value)
    return shown if stderr is None else f"{shown} ± {number(Z95 * factor * stderr, 2)}"


def _curve(several: Sequence[Recording], series: Series) -> dict[str, list[float]]:
    """Points of a parameter over time with the ends of their 95 % intervals, as far as it can be."""
    parameter = series.parameter
    size, _ = display(parameter, "")
    curve: dict[str, list[float]] = {"x": [], "y": [], "low": [], "high": []}
    for one in several:
        if parameter in one.estimates:
            value, stderr = one.estimates[parameter]
            reach = Z95 * (stderr or 0.0)
            curve["x"].append(one.time.timestamp() * 1000.0)
            for key, end in (("y", value), ("low", max(value - reach, series.least)), ("high", value + reach)):
                curve[key].append(float(f"{size * end:.6g}"))
    return curve


def _commands(model: str, joint: str, newest: Recording) -> Iterator[str]:
    """Lines for a shell that give a recording its full report."""
    bag = newest.bag
    if "://" in bag:
        bag = PurePosixPath(bag).name
        copy = f"import fsspec; fs, path = fsspec.url_to_fs({newest.bag!r}); fs.get(path, {bag!r}, recursive=True)"
        yield shlex.join([sys.executable, "-c", copy])
    names = [] if joint == newest.joint else ["--joint", f"{joint}={newest.joint}"]
    output = re.sub(r"[^\w.-]+", "_", f"{newest.robot}-{newest.joint}-{str(newest.time)[:10]}")
    words = ["refine", model, bag, *names, "--criterion", "force", "--output", output]
    yield f"{program()} {shlex.join(words)}"
