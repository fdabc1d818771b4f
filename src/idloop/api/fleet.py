"""A fleet: the joints of many robots identified day by day, and compared with their kind and with themselves."""

from __future__ import annotations

import contextlib
import hashlib
import json
import re
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from idloop.api.result import Progress, Result, ignore_progress, part
from idloop.errors import InputError
from idloop.reporting.text.blocks import Block

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from idloop.fleet.bags import FleetBag
    from idloop.fleet.engine import Workers
    from idloop.fleet.joint_day import Settings
    from idloop.fleet.statistics import Components, Finding
    from idloop.fleet.store import Store
    from idloop.physics import Model

WORST = 5  # joints that are diagnosed
DIAGNOSIS_LEVEL = 0.01  # of each joint's diagnosis
MEMORY = "2GB"
_BATCH = 8  # recordings of a task, at most
LOST = "the worker process ended, perhaps at its limit of memory; give more by --memory"


@dataclass(frozen=True)
class Fleet(Result):
    """What is known of a fleet.

    Attributes
    ----------
    source : str
        Table, folder or pattern.
    folder : Path
        Of the results.
    settings : idloop.fleet.joint_day.Settings
        Models and seed.
    bags, new : int
        Recordings, and those of them that were identified now.
    joint_days : int
        Recordings of joints that were identified.
    failed : tuple of dict
        What could not be identified: robot, joint, time, bag and reason.
    components : tuple of Components
        Kind, unit and day of every parameter of every kind.
    tests : int
        Hypotheses that share the rate of false discoveries.
    findings : tuple of Finding
        Odd units, changes and odd days, the most certain first.
    level : float
        Rate of false discoveries.
    since, against : str or None
        First dates of the periods that are compared.
    periods : tuple of Finding
        What changed between two periods: kinds first, then the units that the rate leaves.
    alarms : tuple of Finding
        Of wear, each from its onset on.
    unwatched : tuple of str
        Parameters that could wear and scatter too much for an alarm.
    diagnoses : tuple of dict
        What the catalogue finds of the worst joints, each with its report.
    taken : tuple of FleetBag
        The recordings.
    """

    source: str
    folder: Path
    settings: Settings
    bags: int
    new: int
    joint_days: int
    failed: tuple[dict[str, Any], ...]
    components: tuple[Components, ...]
    tests: int
    findings: tuple[Finding, ...]
    level: float
    since: str | None = None
    against: str | None = None
    periods: tuple[Finding, ...] = ()
    alarms: tuple[Finding, ...] = ()
    unwatched: tuple[str, ...] = ()
    diagnoses: tuple[dict[str, Any], ...] = ()
    taken: tuple[FleetBag, ...] = field(default=(), repr=False)

    def blocks(self) -> Iterator[Block]:
        """Yield what was done, the kinds, the findings and the diagnoses."""
        from idloop.fleet.words import fleet_blocks

        yield from fleet_blocks(self.to_dict())

    def plot(self) -> Figure:
        """Draw the parameters of every kind over time, with the bands of the units."""
        from idloop.fleet.figures import plot_fleet

        return plot_fleet(self.components)

    def to_dict(self) -> dict[str, Any]:
        """Return the document of schema ``idloop/fleet/1``."""
        from idloop import __version__
        from idloop.fleet.alarms import FALSE_ALARMS
        from idloop.fleet.words import component_row, finding_row, misfit_rows, untested_words

        return {
            "schema": "idloop/fleet/1",
            **{key: getattr(self, key) for key in ("source", "bags", "new", "joint_days", "level", "tests")},
            "folder": str(self.folder),
            "version": __version__,
            "settings": self.settings.digests,
            "seed": self.settings.seed,
            "failed": [{**one, "time": one["time"] and one["time"].isoformat()} for one in self.failed],
            "kinds": (kinds := [component_row(one) for one in self.components]),
            "misfits": list(misfit_rows(self.components)),
            "untested": untested_words({"kinds": kinds}),
            "since": self.since,
            "against": self.against,
            **{key: list(map(finding_row, getattr(self, key))) for key in ("findings", "periods", "alarms")},
            "unwatched": list(self.unwatched),
            "recordings_per_false_alarm": FALSE_ALARMS,
            "diagnosis_level": DIAGNOSIS_LEVEL,
            "diagnoses": list(self.diagnoses),
        }

    def save(self, plot: Path | None = None) -> Path:
        """Write fleet.json, fleet.html, the reports of the joints, and units.parquet and findings.parquet for SQL.

        Reports of joints that are no longer in the fleet are removed. `plot`: file of the figure, for the document.
        """
        from idloop.fleet.joints import addresses, file_stems, joint_files, of_files, render_joints
        from idloop.fleet.page import render_fleet
        from idloop.fleet.store import JOINTS, MODELS, Store, write_table
        from idloop.fleet.words import FINDING_COLUMNS, UNIT_COLUMNS, unit_rows
        from idloop.json_values import to_json
        from idloop.output_files import make_folder, write_text

        for one in (JOINTS, MODELS):
            make_folder(self.folder / one, parents=True)
        document = to_json({**self.to_dict(), "plot": plot})
        write_text(self.folder / "fleet.json", json.dumps(document, indent=2, ensure_ascii=False) + "\n")
        made_by = {key: document[key] for key in ("version", "seed")}
        units, findings = (unit_rows(self.components), UNIT_COLUMNS), (document["findings"], FINDING_COLUMNS)
        for name, (rows, columns) in {"units": units, "findings": findings}.items():
            several = [{**one, **made_by, "settings": self.settings.digests[one["kind"]]} for one in rows]
            write_table(self.folder / f"{name}.parquet", several, columns)
        models, store = dict(self.settings.kinds), Store(self.folder)
        of_kind = {kind: self.folder.resolve() / MODELS / f"{stem}.yaml" for kind, stem in file_stems(models).items()}
        for kind, path in of_kind.items():
            write_text(path, models[kind].to_yaml())
        files = joint_files(self.components)
        for kind in dict.fromkeys(one.kind for one in files):
            recordings = store.recordings(self.taken, self.settings, kind)
            for file, own in of_files([one for one in files if one.kind == kind], recordings):
                page = render_joints(file, document, own, str(of_kind[kind]), models[kind].input.joint)
                write_text(self.folder / file.path, page)
        write_text(self.folder / "fleet.html", render_fleet(document, self.components, addresses(files)))
        self._remove_orphans({one.path for one in files}, {name for one in files for name in one.names})
        return self.folder

    def _remove_orphans(self, pages: set[str], joints: set[tuple[str, str]]) -> None:
        """Remove the reports of joints that are no longer in the fleet."""
        from idloop.fleet.store import JOINTS

        for page in (self.folder / JOINTS).glob("*.html"):
            diagnosis = page.with_suffix(".json")
            if diagnosis.exists():
                one = json.loads(diagnosis.read_text(encoding="utf-8"))
                kept = (one["robot"], one["joint"]) in joints
            else:
                kept = f"{JOINTS}/{page.name}" in pages
            if not kept:
                page.unlink()
                diagnosis.unlink(missing_ok=True)


def identify_fleet(
    source: str | Path,
    models: Model | Mapping[str, Model],
    folder: str | Path,
    *,
    since: str | None = None,
    against: str | None = None,
    level: float = 0.05,
    diagnose: int | str = WORST,
    workers: int | None = None,
    memory: str = MEMORY,
    cluster: str | None = None,
    seed: int = 0,
    progress: Progress = ignore_progress,
) -> Fleet:
    """Identify and validate every joint of every recording of a fleet, and find what differs and what changes.

    What is in the folder already is not done again: a recording counts as done by its checksum, the version, the models
    and the seed. Work that was interrupted goes on where it ended.

    Parameters
    ----------
    source : str or Path
        A table (``.csv``, ``.parquet``) with the columns robot, joint, time, bag, and kind if wanted; a folder of
        ROBOT/DATE/BAG; a pattern; or an address of these, such as ``s3://bucket/fleet.parquet``.
    models : Model or mapping of str to Model
        One for all joints, or by kind: a name of the table's column, or a pattern of joint names such as ``wrist*``.
    folder : str or Path
        Of the results.
    since, against : str, optional
        Dates. Compares the recordings from `since` on with those before, not earlier than `against`.
    level : float
        Rate of false discoveries among all that is reported.
    diagnose : int or "all"
        So many of the worst joints, or all joints, go through the whole catalogue of effects and get a report.
    workers : int, optional
        Processes on this machine; one for each core where left out, 0: this one. A script that starts processes needs
        ``if __name__ == "__main__":`` around its work.
    memory : str
        Limit of each process, such as "2GB".
    cluster : str, optional
        Address of a scheduler of Dask, in place of processes here. Its workers need this version and the bags.
    seed : int
    progress : callable, optional
        Called with the share done in [0, 1] and a short text.

    Raises
    ------
    InputError
        The extra ``fleet`` is not installed, nothing to read, dates that are none, no cluster.
    """
    from idloop.fleet.bags import check_place, find_bags

    check_place(str(source))
    with _work(
        source, models, folder, since=since, against=against, level=level, diagnose=diagnose, workers=workers,
        memory=memory, cluster=cluster, seed=seed, progress=progress,
    ) as work:  # fmt: skip
        bags = find_bags(str(source))
        work.check_periods(bags)
        return work.run(bags)


def watch_fleet(
    source: str | Path,
    models: Model | Mapping[str, Model],
    folder: str | Path,
    *,
    ended: threading.Event,
    on_change: Callable[[Fleet], None],
    period: float = 10.0,
    **options: Any,
) -> None:
    """Follow a place in which recordings land.

    A recording is taken when two looks find it unchanged: a recorder writes for as long as it records.

    Parameters
    ----------
    source, models, folder, **options
        As of `identify_fleet`.
    ended : threading.Event
        Ends it when set.
    on_change : callable
        Called with the fleet after new recordings.
    period : float
        Between two looks [s].
    """
    from idloop.fleet.bags import find_bags

    before: dict[str, str] = {}
    known: set[tuple[str, str]] = set()
    with _work(source, models, folder, **options) as work:
        while True:
            bags = find_bags(str(source), empty=True)
            still = [one for one in bags if before.get(one.bag) == one.stamp]
            before = {one.bag: one.stamp for one in bags}
            fresh = {(one.bag, one.stamp) for one in still} - known
            if fresh:
                known |= fresh
                on_change(work.run(still))
            if ended.wait(period):
                return


@contextlib.contextmanager
def _work(
    source: str | Path, models: Model | Mapping[str, Model], folder: str | Path, **options: Any
) -> Iterator[_Work]:
    """Check what is asked for; the workers end with the block."""
    from idloop.fleet.engine import Workers
    from idloop.fleet.joint_day import Settings
    from idloop.fleet.libraries import NEEDED, library
    from idloop.fleet.store import Store

    for name in NEEDED:
        library(name)  # before hours of work, not after
    asked = _Asked(**options)
    settings = Settings(tuple(models.items()) if isinstance(models, Mapping) else (("*", models),), asked.seed)
    with Workers(asked.workers, asked.memory, asked.cluster) as started:
        yield _Work(started, str(source), Store(Path(folder)), settings, asked)


@dataclass(frozen=True)
class _Asked:
    """Options of `identify_fleet`."""

    since: str | None = None
    against: str | None = None
    level: float = 0.05
    diagnose: int | str = WORST
    workers: int | None = None
    memory: str = MEMORY
    cluster: str | None = None
    seed: int = 0
    progress: Progress = ignore_progress

    def __post_init__(self) -> None:
        if not 0.0 < self.level < 1.0:
            raise InputError(f"level is {self.level}: the rate of false discoveries is between 0 and 1, such as 0.05")
        if self.diagnose != "all" and (not isinstance(self.diagnose, int) or self.diagnose < 0):
            raise InputError(f"diagnose is {self.diagnose!r}: give a number of joints, or all")
        if self.since is None and self.against is not None:
            raise InputError("against is given without since, which begins the later period")
        later, earlier = self.days
        if later is not None and earlier is not None and earlier >= later:
            raise InputError(f"against {self.against} is not before since {self.since}: it begins the earlier period")

    @property
    def days(self) -> tuple[float | None, float | None]:
        """First days of the later and the earlier period, counted from 1970."""
        later, earlier = (None if one is None else _day(one) for one in (self.since, self.against))
        return later, earlier


@dataclass(frozen=True)
class _Work:
    """What is done with recordings, once or again and again."""

    workers: Workers
    source: str
    store: Store
    settings: Settings
    asked: _Asked

    def check_periods(self, bags: Sequence[FleetBag]) -> None:
        """Refuse, before any work, a date that leaves one of the periods without a recording."""
        days = [one.time.date().isoformat() for one in bags if one.time is not None]
        if self.asked.since is None or len(days) < len(bags):
            return
        dates = f"the recordings are from {min(days)} to {max(days)}"
        if max(days) < self.asked.since:
            raise InputError(f"since {self.asked.since}: there is no recording from that date on: {dates}")
        if not any((self.asked.against or "") <= day < self.asked.since for day in days):
            begin = f" from {self.asked.against} on" if self.asked.against else ""
            raise InputError(f"since {self.asked.since}: there is no recording{begin} before that date: {dates}")

    def run(self, bags: Sequence[FleetBag]) -> Fleet:
        """Identify what is new, compare all, and diagnose the worst."""
        from idloop.fleet import statistics

        new = self._identify(bags, part(self.asked.progress, 0.0, 0.9))
        self.asked.progress(0.9, "comparing")
        joint_days, failed = self.store.counts(bags, self.settings)
        components = tuple(statistics.take_apart(one) for one in self.store.series(bags, self.settings))
        tests = statistics.Hypotheses(self.asked.level)
        for one in components:
            tests.test(one)
        findings = tests.found()
        periods: list[Finding] = []
        if self.asked.since is not None:
            before = self.asked.days[1]
            compared = [statistics.between_periods(one, _day(self.asked.since), before) for one in components]
            both = [one for kinds, units in compared for one in (*kinds, *units)]
            changes = statistics.Hypotheses(self.asked.level)
            changes.add(np.array([one.p_value for one in both]), both.__getitem__)
            found = changes.found()
            kinds = {(one.kind, one.parameter): one for one in found if not one.robot}
            # The change of a kind is listed whether the rate leaves it or not.
            kinds |= {key: one for one in both if not one.robot and (key := (one.kind, one.parameter)) not in kinds}
            periods = [*kinds.values(), *(one for one in found if one.robot)]
        alarms, unwatched = self._alarms(components)
        diagnoses = self._diagnose(bags, self._worst(components, findings), part(self.asked.progress, 0.92, 1.0))
        self.asked.progress(1.0, "")
        asked = self.asked
        return Fleet(
            self.source, self.store.folder, self.settings, len(bags), new, joint_days, tuple(failed), components,
            tests.count, tuple(findings), asked.level, asked.since, asked.against, tuple(periods), alarms, unwatched,
            tuple(diagnoses), tuple(bags),
        )  # fmt: skip

    def _identify(self, bags: Sequence[FleetBag], progress: Progress) -> int:
        """Identify what is not there yet, and return the number of recordings."""
        from idloop.fleet.joint_day import failed_rows, identify_task, key_of

        done = self.store.done(self.settings)
        left = done.open(bags, self.settings)
        if not left:
            return 0
        progress(0.0, "starting the workers")
        ended, new = 0, 0
        seen = set(done.keys)
        size = min(_BATCH, max(len(left) // (8 * self.workers.count), 1))

        def lost(task: tuple[FleetBag, Sequence[str]]) -> list[dict[str, Any]]:
            # Without its stamp it is tried again by the next call, perhaps with more memory.
            return failed_rows(replace(task[0], stamp=""), self.settings, LOST)

        for batch, results in self.workers.map(identify_task, left, self.settings, size=size, lost=lost):
            kept: list[dict[str, Any]] = []
            for rows in results:
                keys = {key_of(row) for row in rows if "joint" in row} - seen
                kept += [row for row in rows if "joint" not in row or key_of(row) in keys]
                seen |= keys
                new += len(rows) > 1 or "reason" in rows[0]
            self.store.add(kept)
            ended += len(batch)
            progress(ended / len(left), f"{ended} of {len(left)} recordings")
        return new

    def _alarms(self, components: Sequence[Components]) -> tuple[tuple[Finding, ...], tuple[str, ...]]:
        """Alarms of what can wear, and what scatters too much for them."""
        from idloop.fleet.alarms import watched, wear_alarms
        from idloop.fleet.words import kind_text

        names = {kind: watched(model) for kind, model in self.settings.kinds}
        found = [(one, wear_alarms(one)) for one in components if one.series.parameter in names[one.series.kind]]
        kinds = [kind for kind, _ in self.settings.kinds]
        silent = [
            f"{kind_text(one.series.kind, kinds)}: {one.series.parameter}" for one, alarms in found if alarms is None
        ]
        return tuple(alarm for _, alarms in found for alarm in alarms or ()), tuple(silent)

    def _worst(self, components: Sequence[Components], findings: Sequence[Finding]) -> list[tuple[str, str]]:
        """Robot and joint of what is diagnosed: the most certain findings first, then the joints that fit worst."""
        from idloop.fleet.words import misfits

        if self.asked.diagnose == "all":
            return list(dict.fromkeys(name for one in components for name in one.series.names))
        badly = sorted((-error, name) for one in components for name, error in misfits(one).items())
        named = [(one.robot, one.joint) for one in findings if one.robot]
        return list(dict.fromkeys([*named, *(name for _, name in badly)]))[: int(self.asked.diagnose)]

    def _diagnose(
        self, bags: Sequence[FleetBag], worst: Sequence[tuple[str, str]], progress: Progress
    ) -> list[dict[str, Any]]:
        from idloop.fleet.store import JOINTS
        from idloop.output_files import make_folder, write_text

        if not worst:
            return []
        place, tasks = self.store.folder / JOINTS, []
        for one in self.store.newest(worst, bags, self.settings):
            key = hashlib.sha256(f"{one['sha256']} {self.settings.digests[one['kind']]}".encode()).hexdigest()[:8]
            tasks.append({**one, "stem": re.sub(r"[^\w.-]+", "_", f"{one['robot']}-{one['joint']}-{key}")})
        left = [one for one in tasks if not (place / f"{one['stem']}.json").exists()]
        make_folder(place, parents=True)
        ended = self.workers.map(diagnose_joint, left, self.settings, size=1, lost=undiagnosed) if left else ()
        for count, (_, ((found, page),)) in enumerate(ended, start=1):
            if page:
                write_text(place / f"{found['stem']}.html", page)
            write_text(place / f"{found['stem']}.json", json.dumps(found, indent=2, ensure_ascii=False) + "\n")
            progress(count / len(left), f"{count} of {len(left)} joints diagnosed")
        return [json.loads((place / f"{one['stem']}.json").read_text(encoding="utf-8")) for one in tasks]


def diagnose_joint(task: dict[str, Any], settings: Settings) -> tuple[dict[str, Any], str]:
    """Climb the ladder of a joint on its newest recording; return what it finds, and the page of its report."""
    import tempfile

    from idloop.api.ladder import refine
    from idloop.errors import IdloopError, one_line
    from idloop.fleet.joint_day import joint_records, local_copy
    from idloop.fleet.store import JOINTS
    from idloop.json_values import to_json

    try:
        with local_copy(task["bag"]) as path, tempfile.TemporaryDirectory() as scratch:
            records = joint_records(path, settings.model_of(task["kind"], task["joint"]))
            ladder = refine(settings.model_of(task["kind"], task["joint"]), records, criterion="force",
                            level=DIAGNOSIS_LEVEL, seed=settings.seed)  # fmt: skip
            document = ladder.to_dict()
            page = ladder.report(Path(scratch) / "report.html").read_text(encoding="utf-8")
    except IdloopError as error:
        return undiagnosed(task, one_line(error.what))
    p_values = {name: step.p_value for name, step in zip(ladder.added, ladder.steps[1:], strict=True)}
    conclusion = _found_and_left(p_values, document["conclusion"])
    found = {"added": list(ladder.added), "p_values": p_values, "verdict": ladder.verdict, "conclusion": conclusion,
             "parameters": document["parameters"], "report": f"{JOINTS}/{task['stem']}.html"}  # fmt: skip
    return to_json({**task, **found}), page


def _found_and_left(added: Mapping[str, float | None], conclusion: str) -> str:
    """What a diagnosis found, each with its p-value, and its conclusion on the rest."""
    from idloop.p_values import p_text

    names = (f"{name} ({p_text(p)})" if p_text(p) else name for name, p in added.items())
    return f"missing from the model: {', '.join(names)}; beside that, {conclusion}" if added else conclusion


def undiagnosed(task: dict[str, Any], reason: str = LOST) -> tuple[dict[str, Any], str]:
    """What there is of a joint that could not be diagnosed."""
    nothing: dict[str, Any] = {"added": [], "p_values": {}, "verdict": None, "parameters": {}, "report": None}
    return {**task, **nothing, "conclusion": reason}, ""


def _day(text: str) -> float:
    """Day of a date, counted from 1970."""
    try:
        return float((date.fromisoformat(text) - date(1970, 1, 1)).days)
    except ValueError:
        raise InputError(f"{text!r} is no date: write it as 2026-03-01") from None
