"""Results of a live estimator, read from its bag without ROS: fits, parameters, diagnoses, experiments, ladder."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias

from idloop.documents import read_json
from idloop.errors import IdloopError, InputError
from idloop.records.bags.storage.unpacking import limit_bag_readers

_TYPE = "diagnostic_msgs/msg/DiagnosticArray"

Statuses: TypeAlias = tuple[dict[str, str], ...]


def _read_diagnostics(bag: Path, names: Iterable[str]) -> list[tuple[str, Statuses]]:
    """Messages of some of the estimator's topics: last part of the topic, and the values of each status by key."""
    from rosbags.highlevel import AnyReader, AnyReaderError
    from rosbags.typesys import Stores, get_typestore

    limit_bag_readers()
    ends = tuple(f"estimator/{name}" for name in names)
    found = []
    try:
        with AnyReader([bag], default_typestore=get_typestore(Stores.ROS2_KILTED)) as reader:
            wanted = [one for one in reader.connections if one.msgtype == _TYPE and one.topic.endswith(ends)]
            # Without connections the reader would read all messages.
            for connection, _, data in reader.messages(wanted) if wanted else ():
                message: Any = reader.deserialize(data, connection.msgtype)
                statuses = tuple({one.key: one.value for one in status.values} for status in message.status)
                found.append((connection.topic.rsplit("/", 1)[-1], statuses))
    except (AnyReaderError, OSError, LookupError, ValueError) as error:
        raise _unreadable(bag, error) from error
    return found


def _unreadable(bag: Path, error: Exception) -> IdloopError:
    """Error of a bag, or a message in it, that is not in the form that the estimator records."""
    return IdloopError(f"{bag}: cannot be read: {error}")


@dataclass(frozen=True)
class LiveResult:
    """The last result of a run."""

    # FIT per output in percent, on samples that the fit did not use
    fit: dict[str, float] = field(default_factory=dict)
    fit_train: dict[str, float] = field(default_factory=dict)  # FIT per output in percent, on the samples that it used
    # By name: value, stderr (or None), unit; where recorded, whether it is ``trusted`` and ``why``
    parameters: dict[str, dict[str, Any]] = field(default_factory=dict)
    fits: int = 0  # number of fits
    error: str = ""  # reason why the last fit failed; empty otherwise


def read_results(bag: Path) -> LiveResult:
    """Read the estimator's last result from a bag; IdloopError where it cannot be read."""
    newest: dict[str, Statuses] = {}
    fits = 0
    for name, statuses in _read_diagnostics(bag, ("fit", "parameters")):
        newest[name] = statuses
        fits += name == "fit"
    if "fit" not in newest:
        return LiveResult()
    parameters: dict[str, dict[str, Any]] = {}
    try:
        values, *_ = newest["fit"]
        for one in newest.get("parameters", ()):
            stderr = float(one["stderr"]) if one["stderr"] else None
            parameters[one["parameter"]] = {"value": float(one["value"]), "stderr": stderr, "unit": one["unit"]}
            if one.get("why"):
                parameters[one["parameter"]] |= {"trusted": one["trusted"] == "true", "why": one["why"]}
        return LiveResult(
            fit=_numbers(values, "fit/"),
            fit_train=_numbers(values, "train/"),
            parameters=parameters,
            fits=fits,
            error=values["error"],
        )
    except (KeyError, ValueError) as error:
        raise _unreadable(bag, error) from error


def _numbers(values: dict[str, str], prefix: str) -> dict[str, float]:
    return {key.removeprefix(prefix): float(value) for key, value in values.items() if key.startswith(prefix)}


@dataclass(frozen=True)
class Findings:
    """Results of the estimator about missing effects, in the order of the recording."""

    # Documents of schema idloop/diagnose/1, each with ``where`` (lines) and ``windows`` (first and last stamp of each
    # stretch of data in nanoseconds); ``error`` without a document
    diagnoses: tuple[dict[str, Any], ...] = ()
    experiments: tuple[dict[str, Any], ...] = ()  # suggested experiments, as `idloop suggest` writes them
    ladder: dict[str, Any] | None = None  # the newest ladder, schema idloop/refine/1
    evidence: tuple[dict[str, Any], ...] = ()  # every evaluation of the evidence, schema idloop/live_evidence/1


def read_findings(bag: Path) -> Findings:
    """Read the results about missing effects from a bag; IdloopError where it cannot be read."""
    diagnoses: list[dict[str, Any]] = []
    experiments: list[dict[str, Any]] = []
    evidence: list[dict[str, Any]] = []
    ladder: dict[str, Any] | None = None
    try:
        for name, (values, *_) in _read_diagnostics(bag, ("missing_effects", "ladder", "evidence")):
            if name == "evidence":
                evidence.append(read_json(values["document"], "evidence"))
            elif name == "missing_effects":
                diagnoses.append(_diagnosis(values))
            elif values["document"]:
                ladder = read_json(values["document"], "ladder")
                suggested = ladder["suggested_experiment"] if ladder else None
                if suggested is not None and suggested not in experiments[-1:]:
                    experiments.append(suggested)
    except (KeyError, ValueError, InputError) as error:
        raise _unreadable(bag, error) from error
    return Findings(tuple(diagnoses), tuple(experiments), ladder, tuple(evidence))


def _diagnosis(values: dict[str, str]) -> dict[str, Any]:
    document: dict[str, Any] = {"error": values["error"]}
    if values["document"]:
        document = read_json(values["document"], "missing_effects")
    windows = [[int(stamp) for stamp in one.split("-")] for one in values["windows"].split()]
    return document | {"where": read_json(values["where"], "missing_effects"), "windows": windows}
