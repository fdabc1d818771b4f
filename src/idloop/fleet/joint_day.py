"""One recording of a robot: each of its joints identified and validated, as rows of the results."""

from __future__ import annotations

import hashlib
import json
import tempfile
from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import datetime, timezone
from fnmatch import fnmatchcase
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from idloop import __version__
from idloop.errors import IdloopError, InputError, one_line
from idloop.estimation import fit
from idloop.fleet.bags import FleetBag, open_place
from idloop.physics import Model
from idloop.physics.model_file import with_joints
from idloop.records import Record, check_commands, check_identifiable, read_records, read_streams, usable_parts
from idloop.records.bags.bag import Bag
from idloop.records.bags.topics import resolve_topic
from idloop.reporting.provenance import checksum
from idloop.spelling import listed

# Row that has the error of the drive force on unseen halves in the place of a parameter: what no parameter explains.
FORCE_ERROR = "force_error"


@dataclass(frozen=True)
class Settings:
    """What the numbers of a joint depend on besides its recording."""

    kinds: tuple[tuple[str, Model], ...]  # model of each kind of joint, or of the joints whose names match a pattern
    seed: int = 0
    _models: dict[tuple[str, str], Model] = field(default_factory=dict, compare=False, repr=False)

    @cached_property
    def digest(self) -> str:
        """Hash of version, models and seed."""
        return _hash(__version__, self.seed, [(kind, model.to_yaml()) for kind, model in self.kinds])

    @cached_property
    def digests(self) -> dict[str, str]:
        """Hash of version, seed, and the model of one kind alone, by kind."""
        return {kind: _hash(__version__, self.seed, kind, model.to_yaml()) for kind, model in self.kinds}

    def look(self, bag: FleetBag) -> str:
        """Hash of what is looked for in a bag: all models, robot, time and joints."""
        return _hash(self.digest, bag.robot, bag.time and bag.time.isoformat(), bag.joints)

    def job(self, bag: FleetBag, joint: str, kind: str | None) -> str:
        """Hash of what is done with a joint of a bag; without a model of its kind that depends on all models."""
        own = self.digest if kind is None else self.digests[kind]
        return _hash(own, bag.robot, bag.time and bag.time.isoformat(), joint)

    def jobs(self, bag: FleetBag, names: Iterable[str]) -> list[str]:
        """Hash of what is done with each joint of a bag; `names`: joints that one may have where none is given."""
        joints = bag.joints or [(name, "") for name in names]
        return [self.job(bag, joint, self.kind_of(joint, kind)) for joint, kind in joints]

    def kind_of(self, joint: str, stated: str = "") -> str | None:
        """Kind of a joint: the one that is stated, or the first whose pattern matches its name; None without one."""
        same = (name for name, _ in self.kinds if (name == stated if stated else fnmatchcase(joint, name)))
        return next(same, None)

    def model_of(self, kind: str, joint: str) -> Model:
        """Model of a kind with the signals of one joint; its body keeps its name."""
        if (kind, joint) not in self._models:
            model = dict(self.kinds)[kind]
            same = model.input.joint == joint
            self._models[kind, joint] = model if same else with_joints(model, {model.input.joint: joint})
        return self._models[kind, joint]


def _hash(*given: object) -> str:
    return hashlib.sha256(json.dumps(given).encode()).hexdigest()[:16]


def identify_bag(bag: FleetBag, settings: Settings, done: Collection[str] = ()) -> list[dict[str, Any]]:
    """Identify and validate the joints of one recording.

    `done`: checksums and jobs, see `key_of`, of which the results are there already. Returns rows in the columns of
    `idloop.fleet.store.COLUMNS`: a row for the look at the recording, without a joint, and a row for each parameter of
    each joint that is not done already. What cannot be done is one row without a parameter, with the reason.
    """
    look = _look(bag, settings)
    try:
        with local_copy(bag.bag) as path:
            if not path.exists():
                return failed_rows(bag, settings, f"{bag.bag}: there is no bag, check the path")
            look["sha256"] = checksum(path)["sha256"]
            return [look] if key_of(look) in done else [look, *_rows(path, bag, settings, look, done)]
    except Exception as error:  # noqa: BLE001  (a bag may hold anything, and costs its own row only)
        return [look | {"reason": _reason(error)}]


def identify_task(task: tuple[FleetBag, Collection[str]], settings: Settings) -> list[dict[str, Any]]:
    """As `identify_bag`, with what is done as a part of the task."""
    return identify_bag(task[0], settings, task[1])


def failed_rows(bag: FleetBag, settings: Settings, reason: str) -> list[dict[str, Any]]:
    """Row of a recording of which nothing was identified."""
    return [_look(bag, settings) | {"reason": reason}]


def _look(bag: FleetBag, settings: Settings) -> dict[str, Any]:
    return {
        "robot": bag.robot, "time": bag.time, "bag": bag.bag, "stamp": bag.stamp, "job": settings.look(bag),
        "settings": settings.digest, "version": __version__, "seed": settings.seed,
    }  # fmt: skip


def key_of(row: dict[str, Any]) -> str:
    """Checksum and job of a row: equal ones give equal results."""
    return f"{row.get('sha256') or row['bag']} {row['job']}"


def _rows(
    path: Path, bag: FleetBag, settings: Settings, look: dict[str, Any], done: Collection[str]
) -> Iterator[dict[str, Any]]:
    with Bag(path) as opened:
        for joint, kind in bag.joints or _joints_in(opened, settings):
            found = settings.kind_of(joint, kind)
            named = look | {"joint": joint, "kind": found or kind or None, "job": settings.job(bag, joint, found)}
            if found is None:
                what = f"of kind {kind}" if kind else "of that name"
                yield named | {"reason": f"joint {joint}: no model for one {what}; give --model KIND=FILE"}
            elif key_of(named) not in done:
                named["settings"] = settings.digests[found]
                try:
                    yield from identify_joint(opened, settings.model_of(found, joint), named)
                except Exception as error:  # noqa: BLE001  (as above: the other joints are identified)
                    yield named | {"reason": _reason(error)}


def _reason(error: Exception) -> str:
    """What is wrong, without a cure by the options of other verbs."""
    return one_line(error.what if isinstance(error, IdloopError) else f"{type(error).__name__}: {error}")


def _joints_in(bag: Bag, settings: Settings) -> Sequence[tuple[str, str]]:
    """Joints of a bag that have a model."""
    topics = {model.outputs[0].topic: None for _, model in settings.kinds}
    names = [
        name
        for topic in topics
        for stream in read_streams(bag, [resolve_topic(topic, bag.topics, bag.path)]).values()
        for name in stream.names
    ]
    found = [(name, "") for name in dict.fromkeys(names) if settings.kind_of(name) is not None]
    if not found:
        raise InputError(f"{bag.path}: no model fits a joint of it: it has {listed(names)}; give --model 'NAME=FILE'")
    return found


def joint_records(bag: Bag | Path, model: Model) -> list[Record]:
    """Read the records of one joint that a fit can use."""
    return usable_parts(check_commands(read_records(bag, model)), check_identifiable)


def identify_joint(bag: Bag | Path, model: Model, common: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Yield the rows of one joint: its parameters, and the error of the drive force.

    The parameters are those of the whole recording; each of its halves is judged by the parameters of the other.
    """
    records = joint_records(bag, model)
    found = fit(model, records, criterion="force")
    residual = found.residuals[0].value[:, 0]
    noticed = [one.text for record in records for one in record.findings if one.level == "warning"]
    started = datetime.fromtimestamp(records[0].start_ns * 1e-9, tz=timezone.utc)
    common = common | {
        "time": common["time"] or started, "seconds": sum(one.duration for one in records),
        "samples": sum(one.time.size for one in records), "error_fitted": found.force_error,
        "error_unseen": found.force_error_unseen,
        "force_residual": float(np.sqrt(np.mean(residual**2))), "force_unit": model.units.force,
        "notes": "; ".join(dict.fromkeys((*found.warnings, *noticed))) or None,
    }  # fmt: skip
    units = {one.name: one.unit for one in found.model.parameters}
    for name, value, stderr in zip(found.names, found.values.tolist(), found.stderr.tolist(), strict=True):
        known = stderr if np.isfinite(stderr) else None
        yield common | {"parameter": name, "value": value, "stderr": known, "unit": units[name]}
    yield common | {"parameter": FORCE_ERROR, "value": found.force_error_unseen, "stderr": None, "unit": "1"}


@contextmanager
def local_copy(bag: str) -> Iterator[Path]:
    """Path of a bag on this machine: its own, or that of a copy that is removed afterwards."""
    if "://" not in bag:
        yield Path(bag)
        return
    fs, path = open_place(bag)
    with tempfile.TemporaryDirectory(prefix="idloop-fleet-") as folder:
        target = Path(folder) / path.rstrip("/").rpartition("/")[2]
        if fs.exists(path):
            fs.get(path, str(target), recursive=True)
        yield target
